# Empty dependencies file for knead_kernel_AVX512_F64.
# This may be replaced when dependencies are built.
