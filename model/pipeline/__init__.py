"""What is done with a clip or an observation: the only place that knows the order of the stages.

The command line and the workers of the service call the same functions.
"""

from model.pipeline.diagnosis import diagnose
from model.pipeline.observation import observe
from model.pipeline.options import TwinOptions
from model.pipeline.twin import TwinResult, build_twin

__all__ = ["TwinOptions", "TwinResult", "build_twin", "diagnose", "observe"]
