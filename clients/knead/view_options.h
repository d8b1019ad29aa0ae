#include "clients/knead/view_panels.h"
