file(REMOVE_RECURSE
  "CMakeFiles/test_clients_report.dir/clients/test_report.c.o"
  "CMakeFiles/test_clients_report.dir/clients/test_report.c.o.d"
  "test_clients_report"
  "test_clients_report.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_clients_report.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
