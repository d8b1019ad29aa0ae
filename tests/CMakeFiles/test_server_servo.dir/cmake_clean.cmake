file(REMOVE_RECURSE
  "CMakeFiles/test_server_servo.dir/server/test_servo.c.o"
  "CMakeFiles/test_server_servo.dir/server/test_servo.c.o.d"
  "test_server_servo"
  "test_server_servo.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_server_servo.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
