"""Scenes by the thousand, made up from a seed: what pgfmd refuses or chokes on, and whether its results hold together.

    python -m tests.fuzz check --seed 7 --count 3000              reads scenes, and judges what is said of them
    python -m tests.fuzz run --seed 7 --count 300 --workers 2     runs them, and judges what is written
    python -m tests.fuzz relate --seed 7 --count 100              runs each twice, in two ways that must agree
    python -m tests.fuzz show 7 123                               prints scene 123 of seed 7

A scene follows from seed, number and kind alone. What is found is told with the scene's file and the command that
repeats it; the exit code is 1 if there was any fault. declarations.py: what pgfmd declares of its keys, which drives
all the rest; scenes.py: plausible scenes; mutations.py: absurd ones; judging_checks.py, judging_results.py: what is a
fault; relations.py: pairs of runs that must agree; running.py: a run in a process of its own, with a limit of time.
"""
