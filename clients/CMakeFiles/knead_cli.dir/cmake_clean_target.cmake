file(REMOVE_RECURSE
  "libknead_cli.a"
)
