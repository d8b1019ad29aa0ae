#include "clients/knead/object_still.h"
