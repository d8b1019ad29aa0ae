file(REMOVE_RECURSE
  "CMakeFiles/test_core_contact.dir/core/test_contact.c.o"
  "CMakeFiles/test_core_contact.dir/core/test_contact.c.o.d"
  "test_core_contact"
  "test_core_contact.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_core_contact.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
