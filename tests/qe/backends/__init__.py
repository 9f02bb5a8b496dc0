"""Every test of all elimination back ends is one of the referees, too."""

from robust.backends import ELIMINATORS
from tests.qe.referees import REFEREES

ELIMINATORS.update(REFEREES)
