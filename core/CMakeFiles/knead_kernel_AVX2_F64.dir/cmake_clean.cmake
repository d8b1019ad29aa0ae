file(REMOVE_RECURSE
  "CMakeFiles/knead_kernel_AVX2_F64.dir/kernel.c.o"
  "CMakeFiles/knead_kernel_AVX2_F64.dir/kernel.c.o.d"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/knead_kernel_AVX2_F64.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
