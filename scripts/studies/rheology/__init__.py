"""How many Maxwell elements a power law needs, and made-up data to fit."""
