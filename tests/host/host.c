/* A small importer for systems that the tests' own tools do not run on.

   host CASE ANSWER: CASE holds lines of UTF-8: path of the library, GUID, resource location, then numbers: step (bits of
   the double in hexadecimal, as all numbers), steps, how many inputs and outputs, their value references, and the inputs
   of each step. ANSWER gets the outputs after each step, of four runs that must be the same: alone, from the middle on
   after fmi2SetFMUstate, the same in an instance that got the state as bytes, and twice at once in two threads.
   Ends with status 1 and a line on stderr where they differ or a call fails. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2FunctionTypes.h"

#ifdef _WIN32
#define WIN32_LEAN_AND_MEAN
#include <windows.h>
#else
#include <dlfcn.h>
#include <pthread.h>
#endif

static void* library;

static void fail(const char* what) {
  fprintf(stderr, "host: %s\n", what);
  exit(1);
}

static void* function(const char* name) {
#ifdef _WIN32
  void* found = (void*)GetProcAddress((HMODULE)library, name);
#else
  void* found = dlsym(library, name);
#endif
  if (!found) fail(name);
  return found;
}
#define FMI(name) ((name##TYPE*)function(#name))

static void load(const char* path) {
#ifdef _WIN32
  static wchar_t wide[40000];
  MultiByteToWideChar(CP_UTF8, 0, path, -1, wide, 40000);
  library = (void*)LoadLibraryW(wide);
  if (!library) fprintf(stderr, "host: LoadLibrary: error %lu\n", GetLastError());
#else
  library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
  if (!library) fprintf(stderr, "host: %s\n", dlerror());
#endif
  if (!library) fail(path);
}

static void logger(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...) {
  (void)environment, (void)name;
  if (status != fmi2OK) fprintf(stderr, "%s: %s\n", category, message);
}

static char guid[1000], location[40000];
static double step;
static size_t steps, inputs, outputs;
static fmi2ValueReference *input, *output;
static double* values; /* steps x inputs */
static const fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};

static void line(FILE* file, char* text, int size) {
  if (!fgets(text, size, file)) fail("the case is cut short");
  text[strcspn(text, "\r\n")] = 0;
}

static double number(FILE* file) {
  unsigned long long bits;
  double value;
  if (fscanf(file, "%llx", &bits) != 1) fail("the case is cut short");
  memcpy(&value, &bits, sizeof value);
  return value;
}

static size_t whole(FILE* file) {
  unsigned long long value;
  if (fscanf(file, "%llu", &value) != 1) fail("the case is cut short");
  return (size_t)value;
}

static void check(fmi2Status status, const char* what) {
  if (status != fmi2OK) fail(what);
}

static fmi2Component instantiate(void) {
  fmi2Component c = FMI(fmi2Instantiate)("host", fmi2CoSimulation, guid, location, &callbacks, fmi2False, fmi2False);
  if (!c) fail("fmi2Instantiate");
  check(FMI(fmi2SetupExperiment)(c, fmi2False, 0, 0, fmi2False, 0), "fmi2SetupExperiment");
  if (inputs) check(FMI(fmi2SetReal)(c, input, inputs, values), "fmi2SetReal");
  check(FMI(fmi2EnterInitializationMode)(c), "fmi2EnterInitializationMode");
  check(FMI(fmi2ExitInitializationMode)(c), "fmi2ExitInitializationMode");
  return c;
}

/* Steps [first, last): their outputs to `found`. */
static void run(fmi2Component c, size_t first, size_t last, double* found) {
  for (size_t k = first; k < last; ++k) {
    if (inputs) check(FMI(fmi2SetReal)(c, input, inputs, values + k * inputs), "fmi2SetReal");
    check(FMI(fmi2DoStep)(c, (double)k * step, step, fmi2True), "fmi2DoStep");
    check(FMI(fmi2GetReal)(c, output, outputs, found + k * outputs), "fmi2GetReal");
  }
}

static double* room(void) {
  double* found = calloc(steps * outputs + 1, sizeof(double));
  if (!found) fail("memory");
  return found;
}

#ifdef _WIN32
static DWORD WINAPI in_thread(void* found) {
#else
static void* in_thread(void* found) {
#endif
  fmi2Component c = instantiate();
  run(c, 0, steps, found);
  FMI(fmi2FreeInstance)(c);
  return 0;
}

static void in_two_threads(double* found[2]) {
#ifdef _WIN32
  HANDLE thread[2];
  for (int k = 0; k < 2; ++k) thread[k] = CreateThread(NULL, 0, in_thread, found[k], 0, NULL);
  WaitForMultipleObjects(2, thread, TRUE, INFINITE);
#else
  pthread_t thread[2];
  for (int k = 0; k < 2; ++k) pthread_create(&thread[k], NULL, in_thread, found[k]);
  for (int k = 0; k < 2; ++k) pthread_join(thread[k], NULL);
#endif
}

static void same(const double* a, const double* b, size_t first, const char* what) {
  if (memcmp(a + first * outputs, b + first * outputs, (steps - first) * outputs * sizeof(double)) != 0) fail(what);
}

int main(int count, char** arguments) {
  static char path[40000];
  FILE* file = count == 3 ? fopen(arguments[1], "rb") : NULL;
  if (!file) fail("usage: host CASE ANSWER");
  line(file, path, sizeof path);
  line(file, guid, sizeof guid);
  line(file, location, sizeof location);
  step = number(file);
  steps = whole(file), inputs = whole(file), outputs = whole(file);
  input = calloc(inputs + 1, sizeof *input), output = calloc(outputs + 1, sizeof *output);
  values = calloc(steps * inputs + 1, sizeof *values);
  for (size_t k = 0; k < inputs; ++k) input[k] = (fmi2ValueReference)whole(file);
  for (size_t k = 0; k < outputs; ++k) output[k] = (fmi2ValueReference)whole(file);
  for (size_t k = 0; k < steps * inputs; ++k) values[k] = number(file);
  fclose(file);

  load(path);
  double *once = room(), *again = room(), *other = room(), *both[2] = {room(), room()};
  fmi2Component c = instantiate(), d = instantiate();
  fmi2FMUstate state = NULL, copy = NULL;
  const size_t middle = steps / 2;
  run(c, 0, middle, once);
  check(FMI(fmi2GetFMUstate)(c, &state), "fmi2GetFMUstate");
  run(c, middle, steps, once);
  check(FMI(fmi2SetFMUstate)(c, state), "fmi2SetFMUstate");
  run(c, middle, steps, again);
  same(once, again, middle, "another result after fmi2SetFMUstate");

  size_t size = 0;
  check(FMI(fmi2SerializedFMUstateSize)(c, state, &size), "fmi2SerializedFMUstateSize");
  char* bytes = malloc(size);
  check(FMI(fmi2SerializeFMUstate)(c, state, bytes, size), "fmi2SerializeFMUstate");
  check(FMI(fmi2DeSerializeFMUstate)(d, bytes, size, &copy), "fmi2DeSerializeFMUstate");
  check(FMI(fmi2SetFMUstate)(d, copy), "fmi2SetFMUstate");
  run(d, middle, steps, other);
  same(once, other, middle, "another result from a serialised state");
  check(FMI(fmi2FreeFMUstate)(c, &state), "fmi2FreeFMUstate");
  check(FMI(fmi2Terminate)(c), "fmi2Terminate");
  FMI(fmi2FreeInstance)(c);
  FMI(fmi2FreeInstance)(d);

  in_two_threads(both);
  same(once, both[0], 0, "another result in a thread");
  same(once, both[1], 0, "another result in a thread");

  file = fopen(arguments[2], "wb");
  if (!file || fwrite(once, sizeof(double), steps * outputs, file) != steps * outputs || fclose(file) != 0)
    fail("the answer cannot be written");
  return 0;
}
