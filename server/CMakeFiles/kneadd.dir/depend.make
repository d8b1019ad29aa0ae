# Empty dependencies file for kneadd.
# This may be replaced when dependencies are built.
