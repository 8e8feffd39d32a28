// On Arm in front of Eigen, whose sums of products would round once there where those for x86 round twice. Not an
// option of the compiler, as arm_neon.h asks for the same macro.
#pragma once
#include <arm_neon.h>
#undef __ARM_FEATURE_FMA
