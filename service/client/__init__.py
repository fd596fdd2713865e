"""A typed client of the service: submit a clip, wait with progress, download the twin.

Example::

    from service.client import Client, TwinRequest

    with Client("http://127.0.0.1:8000", key) as client:
        twin = client.submit(Path("clip.mp4"), TwinRequest(size_m=0.25))
        twin.wait(lambda job: print(job.stage, job.progress))
        twin.download("bundle.twin.zip", Path("clip.twin.zip"))
        diagnosis = twin.diagnose(Path("seen.npz"))
        diagnosis.wait()
        print(diagnosis.report().verdict.statement)
"""

from model.job_schema import DiagnosisRequest, TwinRequest
from service.client.client import Client
from service.client.remote import Diagnosis, RemoteJob, Twin
from service.client.transport import ServiceError

__all__ = ["Client", "Diagnosis", "DiagnosisRequest", "RemoteJob", "ServiceError", "Twin", "TwinRequest"]
