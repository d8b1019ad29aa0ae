# Empty compiler generated dependencies file for knead_kernel_AVX2_F64.
# This may be replaced when dependencies are built.
