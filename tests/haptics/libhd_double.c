/* A double of the part of OpenHaptics' libHD that otwarp calls, for tests: devices by name, a thread as scheduler at
 * 1 kHz, simulated positions, injected errors, a record of forces, and a count of calls that the real library would not
 * take. The current device is one of the whole process and the error stack one per thread: the less kind reading of what
 * the API reference leaves open.
 *
 * cc -O1 -shared -fPIC -pthread libhd_double.c -o libhd_double.so
 */
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

typedef unsigned int HHD;
typedef struct {
    unsigned int code;
    int internal;
    HHD handle;
} ErrorInfo;
typedef unsigned int (*Callback)(void *);

enum { DEVICES = 4, STACK = 8, INVALID = -1 };
enum {
    INVALID_ENUM = 0x0100,
    INVALID_OPERATION = 0x0102,
    BAD_HANDLE = 0x0104,
    DEVICE_FAULT = 0x0300,
    ALREADY_INITIATED = 0x0301,
    COMM_ERROR = 0x0302,
    ILLEGAL_BEGIN = 0x0400,
    FRAME_ERROR = 0x0402
};

typedef struct {
    char name[64], serial[32];
    int plugged, open, enabled, framed;
    double position[3], force[3], applied[3], peak, nominal[2];
    int buttons, error_once, error_handle, frames, says_forces;
} Device;

static Device devices[DEVICES];
static int thief = INVALID; /* becomes current in the midst of the next frame, as if by another thread */
static int count, current = INVALID, mistakes, open_delay_ms, scheduled, most_scheduled, ticks, running, stalled;
static Callback callback;
static void *callback_data;
static unsigned short priority;
static pthread_t thread;
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t ticked = PTHREAD_COND_INITIALIZER;
static __thread ErrorInfo stack[STACK];
static __thread int depth;

static void fail(unsigned int code, HHD handle) {
    if (depth < STACK) stack[depth++] = (ErrorInfo){code, 0, handle};
}

static void pause_ms(int ms) {
    struct timespec t = {ms / 1000, (ms % 1000) * 1000000L};
    nanosleep(&t, 0);
}

static Device *of(HHD handle) { return handle < (HHD)count && devices[handle].open ? &devices[handle] : 0; }

/* what the tests call */

void double_reset(void) {
    memset(devices, 0, sizeof devices);
    count = mistakes = open_delay_ms = most_scheduled = ticks = stalled = 0;
    current = thief = INVALID;
    depth = 0;
}

int double_add(const char *name, const char *serial, double force, double continuous) {
    Device *d = &devices[count];
    strncpy(d->name, name, sizeof d->name - 1);
    strncpy(d->serial, serial, sizeof d->serial - 1);
    d->plugged = 1;
    d->says_forces = force > 0;
    d->nominal[0] = force;
    d->nominal[1] = continuous;
    return count++;
}

/* for a process that a test cannot reach into: names with commas between them; the first device lies 10 mm to the right,
 * the next 20 mm */
__attribute__((constructor)) static void begin(void) {
    const char *given = getenv("LIBHD_DOUBLE_DEVICES");
    char names[256] = "", *rest = 0;
    if (given) strncpy(names, given, sizeof names - 1);
    for (char *name = strtok_r(names, ",", &rest); name && count < DEVICES; name = strtok_r(0, ",", &rest)) {
        int i = double_add(name, name, 3.3, 0.88);
        devices[i].position[0] = 10.0 * (i + 1);
    }
}

void double_move(int i, double x, double y, double z, int buttons) {
    pthread_mutex_lock(&lock);
    devices[i].position[0] = x, devices[i].position[1] = y, devices[i].position[2] = z;
    devices[i].buttons = buttons;
    pthread_mutex_unlock(&lock);
}

void double_plug(int i, int plugged) { devices[i].plugged = plugged; }
/* an error in the next frame of i, which names the device `handle` */
void double_fail(int i, int code, int handle) { devices[i].error_handle = handle, devices[i].error_once = code; }
void double_delay(int ms) { open_delay_ms = ms; }
void double_stall(int yes) { stalled = yes; }
void double_steal(int i) { thief = i; }
int double_stolen(void) { return thief == INVALID; }

void double_force(int i, double *out) {
    pthread_mutex_lock(&lock);
    memcpy(out, devices[i].applied, 3 * sizeof(double));
    pthread_mutex_unlock(&lock);
}

/* what it was told last, whether its motors were on or not */
void double_told(int i, double *out) {
    pthread_mutex_lock(&lock);
    memcpy(out, devices[i].force, 3 * sizeof(double));
    pthread_mutex_unlock(&lock);
}

/* largest force since it was asked last */
double double_peak(int i) {
    pthread_mutex_lock(&lock);
    double peak = devices[i].peak;
    devices[i].peak = 0;
    pthread_mutex_unlock(&lock);
    return peak;
}

int double_open(int i) { return devices[i].open; }
int double_enabled(int i) { return devices[i].enabled; }
int double_frames(int i) { return devices[i].frames; }
int double_mistakes(void) { return mistakes; }
int double_running(void) { return running; }
int double_scheduled(void) { return scheduled; }
int double_most_scheduled(void) { return most_scheduled; }
int double_priority(void) { return priority; }

/* wait for n whole ticks; 0 if the scheduler does not run */
int double_wait(int n) {
    pthread_mutex_lock(&lock);
    int until = ticks + n + 1; /* the one under way may have begun before what the test did last */
    while (running && scheduled && ticks < until) {
        struct timespec t;
        clock_gettime(CLOCK_REALTIME, &t);
        t.tv_sec += 1;
        pthread_cond_timedwait(&ticked, &lock, &t);
    }
    int done = ticks >= until;
    pthread_mutex_unlock(&lock);
    return done;
}

/* what otwarp calls */

HHD hdInitDevice(const char *name) {
    int i = 0;
    while (i < count && name && strcmp(devices[i].name, name)) i++;
    if (i >= count || !devices[i].plugged) {
        pause_ms(open_delay_ms);
        fail(DEVICE_FAULT, INVALID);
        return INVALID;
    }
    if (devices[i].open) {
        fail(ALREADY_INITIATED, i);
        return INVALID;
    }
    devices[i].open = 1;
    devices[i].enabled = devices[i].framed = 0;
    current = i;
    pause_ms(open_delay_ms);
    return i;
}

void hdDisableDevice(HHD h) {
    Device *d = of(h);
    if (!d) {
        mistakes++;
        fail(BAD_HANDLE, h);
        return;
    }
    d->open = d->enabled = 0;
    memset(d->applied, 0, sizeof d->applied);
}

void hdMakeCurrentDevice(HHD h) {
    if (of(h)) current = h;
    else mistakes++, fail(BAD_HANDLE, h);
}

HHD hdGetCurrentDevice(void) { return current; }

void hdBeginFrame(HHD h) {
    Device *d = of(h);
    if (!d) {
        mistakes++;
        fail(BAD_HANDLE, h);
        return;
    }
    if (d->framed) mistakes++, fail(ILLEGAL_BEGIN, h);
    d->framed = 1;
    if (!d->plugged) fail(COMM_ERROR, h);
    if (d->error_once) fail(d->error_once, d->error_handle), d->error_once = 0;
}

void hdEndFrame(HHD h) {
    Device *d = of(h);
    if (!d || !d->framed) {
        mistakes++;
        fail(FRAME_ERROR, h);
        return;
    }
    pthread_mutex_lock(&lock);
    d->framed = 0;
    d->frames++;
    for (int k = 0; k < 3; k++) d->applied[k] = d->enabled && d->plugged ? d->force[k] : 0;
    double *f = d->applied, size = sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
    if (!(size <= d->peak)) d->peak = size;
    pthread_mutex_unlock(&lock);
}

static Device *now(void) {
    Device *d = current == INVALID ? 0 : of(current);
    if (!d) mistakes++, fail(INVALID_OPERATION, current);
    return d;
}

void hdEnable(unsigned int what) {
    Device *d = now();
    if (d && what == 0x4000) d->enabled = 1;
    else fail(INVALID_ENUM, current);
}

void hdDisable(unsigned int what) {
    Device *d = now();
    if (d && what == 0x4000) d->enabled = 0;
    else fail(INVALID_ENUM, current);
}

void hdGetDoublev(unsigned int what, double *out) {
    if (thief != INVALID && thief != current) current = thief, thief = INVALID;
    Device *d = now();
    if (!d) return;
    if ((what == 0x2603 || what == 0x2604) && d->says_forces) {
        out[0] = d->nominal[what - 0x2603];
        return;
    }
    if (what != 0x2050) {
        fail(INVALID_ENUM, current);
        return;
    }
    pthread_mutex_lock(&lock);
    memcpy(out, d->position, sizeof d->position);
    pthread_mutex_unlock(&lock);
}

void hdGetIntegerv(unsigned int what, int *out) {
    Device *d = now();
    if (d && what == 0x2000) *out = d->buttons;
    else fail(INVALID_ENUM, current);
}

void hdSetDoublev(unsigned int what, const double *in) {
    Device *d = now();
    if (!d) return;
    if (what != 0x2700 || !d->framed) {
        mistakes++;
        fail(FRAME_ERROR, current);
        return;
    }
    memcpy(d->force, in, sizeof d->force);
}

const char *hdGetString(unsigned int what) {
    Device *d = now();
    return !d ? 0 : what == 0x2501 ? "Touch" : what == 0x2504 ? d->serial : 0;
}

ErrorInfo hdGetError(void) { return depth ? stack[--depth] : (ErrorInfo){0, 0, INVALID}; }

const char *hdGetErrorString(unsigned int code) {
    return code == COMM_ERROR ? "HD_COMM_ERROR\n" : code == DEVICE_FAULT ? "HD_DEVICE_FAULT" : "HD_ERROR";
}

static void *loop(void *unused) {
    (void)unused;
    while (running) {
        if (!stalled) {
            if (scheduled && callback(callback_data) != 1) scheduled = 0;
            pthread_mutex_lock(&lock);
            ticks++;
            pthread_cond_broadcast(&ticked);
            pthread_mutex_unlock(&lock);
        }
        pause_ms(1);
    }
    return 0;
}

void hdStartScheduler(void) {
    if (running) {
        mistakes++;
        return;
    }
    running = 1;
    pthread_create(&thread, 0, loop, 0);
}

void hdStopScheduler(void) {
    if (!running) {
        mistakes++;
        return;
    }
    running = 0;
    pthread_join(thread, 0);
}

unsigned long hdScheduleAsynchronous(Callback call, void *data, unsigned short urgency) {
    if (scheduled) mistakes++;
    callback = call, callback_data = data, priority = urgency;
    if (++scheduled > most_scheduled) most_scheduled = scheduled;
    return 77;
}

void hdUnschedule(unsigned long handle) {
    if (handle != 77 || !scheduled || running) mistakes++;
    scheduled = 0;
}
