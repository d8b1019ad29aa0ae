#include "clients/knead/tool_path.h"
