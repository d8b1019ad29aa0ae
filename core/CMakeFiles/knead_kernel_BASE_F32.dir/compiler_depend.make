# Empty compiler generated dependencies file for knead_kernel_BASE_F32.
# This may be replaced when dependencies are built.
