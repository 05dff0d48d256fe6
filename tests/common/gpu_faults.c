// A Vulkan layer that lets a device fail. GNOMON_TEST_GPU_FAULT is `submit N` (the N-th submission loses its device), `wait N`
// (the N-th wait does), `memory N` (its device has no memory from its N-th buffer or picture on) or `file PATH` (a submission
// that finds the file takes it away and loses its device). Other devices go on, so that a program
// that opens a new one can work. Only tests load it. The loader's side is as its document LoaderLayerInterface.md has it.
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef int32_t Result;
typedef void (*Function)(void);
typedef Function (*GetProc)(void *, const char *);
typedef Result (*Create)(void *, const void *, const void *, void **);
typedef Result (*Submit)(void *, uint32_t, const void *, uint64_t);
typedef Result (*WaitSemaphores)(void *, const void *, uint64_t);
typedef Result (*WaitFences)(void *, uint32_t, const uint64_t *, uint32_t, uint64_t);
// Of a buffer or an image.
typedef Result (*Make)(void *, const void *, const void *, uint64_t *);

enum { OUT_OF_DEVICE_MEMORY = -2, INITIALIZATION_FAILED = -3, DEVICE_LOST = -4 };
enum { LOADER_INSTANCE_CREATE_INFO = 47, LOADER_DEVICE_CREATE_INFO = 48, LAYER_LINK_INFO = 0 };
enum { MOST_DEVICES = 256 };

struct Link {
    struct Link *next;
    GetProc instance_proc;
    GetProc other_proc; // of physical devices, or of a device
};

struct Chained {
    int32_t type;
    struct Chained *next;
    int32_t function;
    struct Link *link;
};

static struct Device {
    void *key;
    GetProc proc;
    Submit submit;
    WaitSemaphores wait_semaphores;
    WaitFences wait_fences;
    Make make_buffer, make_image;
    atomic_int is_lost, is_full;
} devices[MOST_DEVICES];
static atomic_int device_count;
static GetProc next_instance_proc;
static atomic_long submissions, waits, makings;

// What the loader hands out begins with a pointer that all handles of a device share.
static struct Device *device_of(void *handle) {
    for (int k = device_count - 1; k >= 0; k--)
        if (devices[k].key == *(void **)handle) return &devices[k];
    fputs("gpu_faults: a device that nobody has made\n", stderr);
    abort();
}

static int is_due(const char *kind, atomic_long *counter) {
    const char *fault = getenv("GNOMON_TEST_GPU_FAULT");
    size_t length = strlen(kind);
    long count = atomic_fetch_add(counter, 1) + 1;
    return fault && !strncmp(fault, kind, length) && count == atol(fault + length);
}

static int is_lost(struct Device *device, const char *kind, atomic_long *counter) {
    if (is_due(kind, counter)) device->is_lost = 1;
    return device->is_lost;
}

static Result queue_submit(void *queue, uint32_t count, const void *submits, uint64_t fence) {
    struct Device *device = device_of(queue);
    const char *fault = getenv("GNOMON_TEST_GPU_FAULT");
    if (fault && !strncmp(fault, "file ", 5) && !remove(fault + 5)) device->is_lost = 1;
    return is_lost(device, "submit", &submissions) ? DEVICE_LOST : device->submit(queue, count, submits, fence);
}

static Result wait_semaphores(void *handle, const void *info, uint64_t timeout) {
    struct Device *device = device_of(handle);
    return is_lost(device, "wait", &waits) ? DEVICE_LOST : device->wait_semaphores(handle, info, timeout);
}

static Result wait_fences(void *handle, uint32_t count, const uint64_t *fences, uint32_t all, uint64_t timeout) {
    struct Device *device = device_of(handle);
    return is_lost(device, "wait", &waits) ? DEVICE_LOST : device->wait_fences(handle, count, fences, all, timeout);
}

static int is_full(struct Device *device) {
    if (is_due("memory", &makings)) device->is_full = 1;
    return device->is_full;
}

static Result create_buffer(void *handle, const void *info, const void *allocator, uint64_t *made) {
    struct Device *device = device_of(handle);
    return is_full(device) ? OUT_OF_DEVICE_MEMORY : device->make_buffer(handle, info, allocator, made);
}

static Result create_image(void *handle, const void *info, const void *allocator, uint64_t *made) {
    struct Device *device = device_of(handle);
    return is_full(device) ? OUT_OF_DEVICE_MEMORY : device->make_image(handle, info, allocator, made);
}

static struct Chained *link_in(const void *info, int32_t type) {
    struct Chained *chained = ((const struct Chained *)info)->next;
    while (chained && !(chained->type == type && chained->function == LAYER_LINK_INFO)) chained = chained->next;
    return chained;
}

static Result create_instance(const void *info, const void *allocator, void **instance) {
    struct Chained *chained = link_in(info, LOADER_INSTANCE_CREATE_INFO);
    if (!chained) return INITIALIZATION_FAILED;
    next_instance_proc = chained->link->instance_proc;
    chained->link = chained->link->next;
    Result (*create)(const void *, const void *, void **) =
        (Result(*)(const void *, const void *, void **))next_instance_proc(0, "vkCreateInstance");
    return create(info, allocator, instance);
}

static Result create_device(void *adapter, const void *info, const void *allocator, void **made) {
    struct Chained *chained = link_in(info, LOADER_DEVICE_CREATE_INFO);
    int index = atomic_fetch_add(&device_count, 1);
    if (!chained || index >= MOST_DEVICES) return INITIALIZATION_FAILED;
    struct Device *device = &devices[index];
    GetProc instance_proc = chained->link->instance_proc;
    device->proc = chained->link->other_proc;
    chained->link = chained->link->next;
    Result result = ((Create)instance_proc(0, "vkCreateDevice"))(adapter, info, allocator, made);
    if (result) return result;
    device->submit = (Submit)device->proc(*made, "vkQueueSubmit");
    device->wait_fences = (WaitFences)device->proc(*made, "vkWaitForFences");
    device->wait_semaphores = (WaitSemaphores)device->proc(*made, "vkWaitSemaphores");
    if (!device->wait_semaphores) device->wait_semaphores = (WaitSemaphores)device->proc(*made, "vkWaitSemaphoresKHR");
    device->make_buffer = (Make)device->proc(*made, "vkCreateBuffer");
    device->make_image = (Make)device->proc(*made, "vkCreateImage");
    device->key = *(void **)*made;
    return result;
}

static Function ours(const char *name) {
    static const struct { const char *name; Function function; } all[] = {
        {"vkCreateInstance", (Function)create_instance},
        {"vkCreateDevice", (Function)create_device},
        {"vkQueueSubmit", (Function)queue_submit},
        {"vkWaitSemaphores", (Function)wait_semaphores},
        {"vkWaitSemaphoresKHR", (Function)wait_semaphores},
        {"vkWaitForFences", (Function)wait_fences},
        {"vkCreateBuffer", (Function)create_buffer},
        {"vkCreateImage", (Function)create_image},
    };
    for (size_t k = 0; k < sizeof all / sizeof *all; k++)
        if (!strcmp(all[k].name, name)) return all[k].function;
    return 0;
}

Function vkGetDeviceProcAddr(void *device, const char *name) {
    if (!strcmp(name, "vkGetDeviceProcAddr")) return (Function)vkGetDeviceProcAddr;
    Function next = device_of(device)->proc(device, name);
    Function own = ours(name);
    // What the device does not have stays missing.
    return next && own ? own : next;
}

Function vkGetInstanceProcAddr(void *instance, const char *name) {
    if (!strcmp(name, "vkGetInstanceProcAddr")) return (Function)vkGetInstanceProcAddr;
    if (!strcmp(name, "vkGetDeviceProcAddr")) return (Function)vkGetDeviceProcAddr;
    Function own = ours(name);
    return own || !next_instance_proc ? own : next_instance_proc(instance, name);
}
