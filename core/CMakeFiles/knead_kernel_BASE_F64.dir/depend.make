# Empty dependencies file for knead_kernel_BASE_F64.
# This may be replaced when dependencies are built.
