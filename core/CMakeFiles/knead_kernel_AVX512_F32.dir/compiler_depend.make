# Empty compiler generated dependencies file for knead_kernel_AVX512_F32.
# This may be replaced when dependencies are built.
