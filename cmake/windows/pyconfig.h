// What Python's headers ask for on 64-bit Windows, as far as the stable ABI goes: Python installed on another system has
// a pyconfig.h of that system. See build_wheels.py.
#pragma once
#define MS_WINDOWS
#define MS_WIN32
#define MS_WIN64
#define Py_ENABLE_SHARED 1
#define HAVE_DECLSPEC_DLL 1
#define SIZEOF_SHORT 2
#define SIZEOF_INT 4
#define SIZEOF_LONG 4
#define SIZEOF_LONG_LONG 8
#define SIZEOF_VOID_P 8
#define SIZEOF_SIZE_T 8
#define SIZEOF_TIME_T 8
#define SIZEOF_WCHAR_T 2
#define SIZEOF_FLOAT 4
#define SIZEOF_DOUBLE 8
#define SIZEOF_PID_T 8
#define ALIGNOF_LONG 4
#define ALIGNOF_SIZE_T 8
#define ALIGNOF_MAX_ALIGN_T 8
#define HAVE_LONG_LONG 1
#define HAVE_PY_SSIZE_T 1
#define PY_SSIZE_T_MAX 0x7FFFFFFFFFFFFFFFLL
#define PY_LLONG_MIN (-PY_SSIZE_T_MAX - 1)
#define PY_LLONG_MAX PY_SSIZE_T_MAX
#define HAVE_SYS_TYPES_H 1
#define HAVE_SYS_STAT_H 1
#define HAVE_STDDEF_H 1
#define HAVE_ERRNO_H 1
typedef long long Py_ssize_t;
