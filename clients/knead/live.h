#include "clients/knead/live_server.h"
