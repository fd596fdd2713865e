"""What Prometheus asks for: requests of this front, and jobs of the whole service."""

from collections.abc import Iterable

from prometheus_client import CollectorRegistry, Counter, Histogram, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily
from prometheus_client.metrics_core import Metric
from prometheus_client.registry import Collector

from worker.counters import Counters
from worker.queues import Queues
from worker.records import Records

BUCKETS = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0)
METHODS = ("GET", "HEAD", "POST", "DELETE")


class Metrics:
    """The counts of one front."""

    def __init__(self) -> None:
        """Start at zero."""
        self._registry = CollectorRegistry()
        self._seconds = Histogram(
            "matphys_http_request_seconds",
            "Time to answer a request",
            ("route", "method", "status"),
            buckets=BUCKETS,
            registry=self._registry,
        )
        self._bytes = Counter("matphys_upload_bytes", "Bytes of accepted uploads", registry=self._registry)

    def request(self, route: str, method: str, status: int, seconds: float) -> None:
        """Count a request; route and method are ours, so that nobody can make labels without end."""
        self._seconds.labels(route, method if method in METHODS else "other", str(status)).observe(seconds)

    def upload(self, size: int) -> None:
        """Count an accepted upload [bytes]."""
        self._bytes.inc(size)

    def text(self) -> bytes:
        """The counts of this front in Prometheus' text format."""
        return generate_latest(self._registry)


class JobCollector(Collector):
    """The jobs of the whole service, read from Redis when asked; any front tells the same."""

    def __init__(self, queues: Queues, records: Records, counters: Counters) -> None:
        """Ask nothing yet."""
        self._queues, self._records, self._counters = queues, records, counters

    def text(self) -> bytes:
        """All of it in Prometheus' text format."""
        registry = CollectorRegistry(auto_describe=False)
        registry.register(self)
        return generate_latest(registry)

    def describe(self) -> Iterable[Metric]:
        """Nothing in advance: to be registered must not ask Redis."""
        return ()

    def collect(self) -> Iterable[Metric]:
        """Queues, workers, outcomes, seconds per stage."""
        depth = GaugeMetricFamily("matphys_queue_depth", "Jobs that wait", labels=("queue",))
        for name, waiting in self._queues.depth().items():
            depth.add_metric((name,), waiting)
        yield depth
        yield GaugeMetricFamily("matphys_jobs_running", "Jobs that run", value=self._records.running())
        yield GaugeMetricFamily("matphys_workers", "Workers alive", value=len(self._queues.workers()))
        outcomes = CounterMetricFamily(
            "matphys_jobs", "Jobs by what became of them", labels=("kind", "outcome")
        )
        for (kind, outcome), count in sorted(self._counters.outcomes().items()):
            outcomes.add_metric((kind, outcome), count)
        yield outcomes
        stages = HistogramMetricFamily("matphys_stage_seconds", "Time of a stage", labels=("kind", "stage"))
        for (kind, stage), took in sorted(self._counters.stages().items()):
            buckets = [(f"{bound:g}", count) for bound, count in took.buckets]
            stages.add_metric((kind, stage), [*buckets, ("+Inf", took.count)], took.seconds)
        yield stages
