"""Jobs around the model: queues, storage, progress. Imports `model`, never `service`."""
