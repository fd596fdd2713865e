"""Diagnoses: what really moved goes in, what the twin lacks comes out."""

from service.resources import Resource
from service.routes.twins import TWINS
from worker.kinds.diagnosis import DiagnosisKind

DIAGNOSES = Resource(
    DiagnosisKind,
    "/diagnoses",
    "diagnosis",
    parent=TWINS,
    title="Diagnose",
    help="Give what really moved, as an observation (.npz) or as the twin's own clip, and learn where the "
    "twin departs from it, which effect it lacks, and how far the gap shrinks with it.",
)
