"""Names of before."""

from ninedisk.core.law import *  # noqa: F403
