#include "clients/knead/replay_trace.h"
