# Empty compiler generated dependencies file for tool_logcheck.
# This may be replaced when dependencies are built.
