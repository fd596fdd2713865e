"""A typed client of the service: submit a clip, wait with progress, download the twin.

Example::

    from service.client import Client, TwinRequest

    with Client("http://127.0.0.1:8000", key) as client:
        twin = client.submit(Path("clip.mp4"), TwinRequest(size_m=0.25))
        twin.wait(lambda job: print(job.stage, job.progress))
        twin.download("bundle.twin.zip", Path("clip.twin.zip"))
"""

from model.job_schema import TwinRequest
from service.client.client import Client
from service.client.remote import RemoteJob, Twin
from service.client.transport import ServiceError

__all__ = ["Client", "RemoteJob", "ServiceError", "Twin", "TwinRequest"]
