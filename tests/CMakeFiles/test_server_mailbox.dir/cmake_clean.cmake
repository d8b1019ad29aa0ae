file(REMOVE_RECURSE
  "CMakeFiles/test_server_mailbox.dir/server/test_mailbox.c.o"
  "CMakeFiles/test_server_mailbox.dir/server/test_mailbox.c.o.d"
  "test_server_mailbox"
  "test_server_mailbox.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_server_mailbox.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
