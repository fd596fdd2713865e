// A CUDA driver for a machine without a device: it runs the threads of a launch one after the other, which is exact
// where threads share nothing.
#include <math.h>
#include <string.h>
#if __has_include("/usr/local/cuda/include/cuda.h")
#include "/usr/local/cuda/include/cuda.h"  // what is defined below must then be what the real driver declares
#else
typedef int CUresult, CUdevice;
typedef void *CUcontext, *CUmodule, *CUfunction, *CUstream;
#endif

#define __device__
#define __global__
struct Place { unsigned x, y, z; };
static thread_local Place threadIdx, blockIdx, blockDim;

// THE KERNELS

static const int CONTEXT = 77, MODULE = 78;
static thread_local int pushed = 0;
static const CUresult GOOD = CUresult(0), INVALID = CUresult(1), NO_CONTEXT = CUresult(201), UNKNOWN = CUresult(500);
struct Known { const char *name; void (*run)(const Frame, const int); };
static const Known KNOWN[] = {
  {"forward_corners", forward_corners},   {"forward_points", forward_points},   {"backward_end", backward_end},
  {"backward_corners", backward_corners}, {"backward_points", backward_points},
};

extern "C" {
int last_first = 0;  // the other way round: where a thread depends on another one, something changes
CUresult cuInit(unsigned flags) { return flags ? INVALID : GOOD; }
CUresult cuDeviceGet(CUdevice *device, int ordinal) { *device = ordinal; return ordinal ? INVALID : GOOD; }
CUresult cuDevicePrimaryCtxRetain(CUcontext *context, CUdevice) { *context = CUcontext(&CONTEXT); return GOOD; }
CUresult cuCtxPushCurrent_v2(CUcontext context) {
  ++pushed;
  return context == CUcontext(&CONTEXT) ? GOOD : INVALID;
}
CUresult cuCtxPopCurrent_v2(CUcontext *context) {
  *context = CUcontext(&CONTEXT);
  return pushed-- ? GOOD : NO_CONTEXT;
}
CUresult cuModuleLoadData(CUmodule *module, const void *image) {
  *module = CUmodule(&MODULE);
  if (!pushed) return NO_CONTEXT;
  return memcmp(image, "serial", 6) ? INVALID : GOOD;
}
CUresult cuModuleGetFunction(CUfunction *function, CUmodule module, const char *name) {
  if (module != CUmodule(&MODULE)) return INVALID;
  for (const Known &known : KNOWN)
    if (!strcmp(known.name, name)) { *function = CUfunction(&known); return GOOD; }
  return UNKNOWN;
}
CUresult cuLaunchKernel(CUfunction function, unsigned x, unsigned y, unsigned z, unsigned threads, unsigned deep,
                        unsigned deeper, unsigned shared, CUstream stream, void **told, void **extra) {
  if (!pushed) return NO_CONTEXT;
  if (!x || !y || z != 1 || !threads || deep != 1 || deeper != 1 || shared || stream || extra) return INVALID;
  blockDim = {threads, 1, 1};
  for (unsigned i = 0; i < x * y * threads; ++i) {
    const unsigned turn = last_first ? x * y * threads - 1 - i : i;
    blockIdx = {turn / threads % x, turn / threads / x, 0};
    threadIdx = {turn % threads, 0, 0};
    ((const Known *)function)->run(*(const Frame *)told[0], *(const int *)told[1]);
  }
  return GOOD;
}
CUresult cuGetErrorString(CUresult error, const char **text) {
  *text = error == NO_CONTEXT ? "invalid device context" : error == UNKNOWN ? "named symbol not found" : "invalid value";
  return GOOD;
}
unsigned long long size_of_frame() { return sizeof(Frame); }
}
