"""The paper's explicit scheme: every mode of the surface is a mass on springs and dashpots."""
