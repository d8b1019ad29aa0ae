# Empty dependencies file for knead_core.
# This may be replaced when dependencies are built.
