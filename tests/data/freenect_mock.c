/* A Kinect that is not there: what of libfreenect.h (0.5) a capture uses, for tests/capture_kinect.rs.
   Unlike fakenect it has a serial, infrared and a factory calibration, and can be pulled out.
   MOCK_FRAMES: frames it gives; MOCK_THEN: "gone" (process_events fails), "silent", "none" (no device). */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/time.h>
#include <unistd.h>

typedef void (*frame_cb)(void *, void *, uint32_t);
typedef struct {
  uint32_t reserved; int resolution; int32_t format; int32_t bytes;
  int16_t width, height; int8_t bits, padding, rate, is_valid;
} frame_mode;
typedef struct {
  int32_t reg_info[29]; uint16_t pad_info[3];
  struct { float emitter, colour, reference, pixel; } zero_plane;
  double const_shift; void *tables[3];
} registration;
struct attributes { struct attributes *next; const char *serial; };

static int context, device, given, depth_on, video_on;
static frame_cb depth_cb, video_cb;
/* One byte off: nobody promised alignment. */
static uint8_t depth[2 * 640 * 480 + 1], infrared[2 * 640 * 488 + 1];

static const char *then(void) { const char *s = getenv("MOCK_THEN"); return s ? s : "gone"; }

int freenect_init(void **ctx, void *usb) { (void)usb; *ctx = &context; return 0; }
int freenect_shutdown(void *ctx) { return ctx == &context ? 0 : -1; }
void freenect_set_log_level(void *ctx, int level) { (void)ctx; (void)level; }
void freenect_set_log_callback(void *ctx, void *cb) { (void)ctx; (void)cb; }
void freenect_select_subdevices(void *ctx, int which) { (void)ctx; if (which != 2) abort(); }
int freenect_num_devices(void *ctx) { (void)ctx; return strcmp(then(), "none") ? 1 : 0; }
int freenect_list_device_attributes(void *ctx, struct attributes **list) {
  (void)ctx;
  *list = malloc(sizeof **list);
  (*list)->next = NULL;
  (*list)->serial = "A00366802050045A";
  return 1;
}
void freenect_free_device_attributes(struct attributes *list) { free(list); }
int freenect_open_device(void *ctx, void **dev, int index) { (void)ctx; (void)index; *dev = &device; return 0; }
int freenect_open_device_by_camera_serial(void *ctx, void **dev, const char *serial) {
  (void)ctx;
  if (strcmp(serial, "A00366802050045A")) return -1;
  *dev = &device;
  return 0;
}
int freenect_close_device(void *dev) { return dev == &device ? 0 : -1; }
frame_mode freenect_find_depth_mode(int resolution, int format) {
  frame_mode mode = {1, resolution, format, 2 * 640 * 480, 640, 480, 11, 5, 30, resolution == 1 && format == 0};
  return mode;
}
frame_mode freenect_find_video_mode(int resolution, int format) {
  frame_mode mode = {2, resolution, format, 2 * 640 * 488, 640, 488, 10, 6, 30, resolution == 1 && format == 3};
  return mode;
}
int freenect_set_depth_mode(void *dev, frame_mode mode) { (void)dev; return mode.bits == 11 && mode.is_valid ? 0 : -1; }
int freenect_set_video_mode(void *dev, frame_mode mode) { (void)dev; return mode.bits == 10 && mode.is_valid ? 0 : -1; }
void freenect_set_depth_callback(void *dev, frame_cb cb) { (void)dev; depth_cb = cb; }
void freenect_set_video_callback(void *dev, frame_cb cb) { (void)dev; video_cb = cb; }
int freenect_start_depth(void *dev) { (void)dev; depth_on = 1; return 0; }
int freenect_stop_depth(void *dev) { (void)dev; depth_on = 0; return 0; }
int freenect_start_video(void *dev) { (void)dev; video_on = 1; return 0; }
int freenect_stop_video(void *dev) { (void)dev; video_on = 0; return 0; }
registration freenect_copy_registration(void *dev) {
  registration r;
  (void)dev;
  memset(&r, 0, sizeof r);
  r.zero_plane.emitter = 7.5f;
  r.zero_plane.colour = 2.3f;
  r.zero_plane.reference = 120.0f;
  r.zero_plane.pixel = 0.1042f;
  r.const_shift = 200.0;
  r.tables[0] = malloc(16);
  return r;
}
int freenect_destroy_registration(registration *r) { free(r->tables[0]); return 0; }

static void put(uint8_t *to, long i, unsigned word) { to[2 * i] = word & 255; to[2 * i + 1] = word >> 8; }

/* A wall seen from the front, word 700 and one more or less; infrared: every row its number. */
int freenect_process_events_timeout(void *ctx, struct timeval *timeout) {
  static uint32_t noise = 1;
  const char *frames = getenv("MOCK_FRAMES");
  (void)ctx;
  if (given >= (frames ? atoi(frames) : 0)) {
    if (!strcmp(then(), "gone")) return -1;
    usleep((useconds_t)timeout->tv_usec);
    return 0;
  }
  usleep(20000);
  given++;
  for (long i = 0; i < 640L * 488; i++) put(infrared + 1, i, (unsigned)(i / 640));
  for (long i = 0; i < 640L * 480; i++) {
    noise = noise * 1664525u + 1013904223u;
    put(depth + 1, i, 699 + (noise >> 30) % 3);
  }
  if (video_on && video_cb) video_cb(&device, infrared + 1, given);
  if (depth_on && depth_cb) depth_cb(&device, depth + 1, given);
  return 0;
}
