"""Time-stepping schemes. Each is a folder with its scheme, controller, kernels and audit.

`base` has the protocols of schemes and controllers. `registry` lists the schemes with their capabilities (`entry`).
`path_following` is shared by the implicit schemes. In a scheme's folder only `plugin` depends on scenes; it is imported
only through the entry.
"""
