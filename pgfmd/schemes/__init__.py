"""Schemes: what a step is, and which steps are taken. Each is a folder with its kernels, controller and audit.

`base` has what is asked of a scheme and of its controller, `registry` the schemes there are, with what each can do
(`entry`), and `path_following` what those share that go from one equilibrium to the next. In a scheme's folder `plugin` alone
knows of scenes; nothing else imports it but by its entry.
"""
