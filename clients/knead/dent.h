#include "clients/knead/tool_height.h"
