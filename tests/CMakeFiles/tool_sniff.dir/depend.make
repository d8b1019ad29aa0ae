# Empty dependencies file for tool_sniff.
# This may be replaced when dependencies are built.
