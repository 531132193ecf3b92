"""Time-stepping schemes.

`inertialess`, the massless limit by implicit steps: it takes a State and a trial step and gives back a Trial, which the
controller alone accepts. `gfmd`, the paper's explicit scheme: it moves the State on. What the simulation asks of both:
`points`, `height`, `law`, `audit`, `pairs`, `transform_seconds`, `new_state`, `start`, `measure`.
"""
