file(REMOVE_RECURSE
  "CMakeFiles/test_golden_golden.dir/golden/test_golden.c.o"
  "CMakeFiles/test_golden_golden.dir/golden/test_golden.c.o.d"
  "test_golden_golden"
  "test_golden_golden.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_golden_golden.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
