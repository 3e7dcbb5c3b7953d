"""What all tests share: the same examples in every run, and no assertion on a clock."""

from hypothesis import HealthCheck, settings
from hypothesis.configuration import set_hypothesis_home_dir

set_hypothesis_home_dir("build/hypothesis")

# derandomize: a failure seen once is seen by everybody. No deadline: the machine may be busy with other work.
settings.register_profile(
    "captain",
    derandomize=True,
    deadline=None,
    database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)
settings.load_profile("captain")
