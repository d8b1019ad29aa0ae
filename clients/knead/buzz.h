#include "clients/knead/haptic_loop.h"
