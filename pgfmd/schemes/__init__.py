"""Time-stepping schemes. Each takes a State and a trial step and gives back a Trial; the controller alone accepts it.

`inertialess` is the massless limit. The paper's `gfmd` and the rate-independent `quasistatic` have their names reserved
in `scene_model.SCHEMES`; a scene that asks for one of them is refused until it is here.
"""

from pgfmd.schemes.inertialess import Inertialess

SCHEMES = {"inertialess": Inertialess}
