// The little of libapriltag that gnomon needs, behind functions whose layout no release changes.
// One detector belongs to one thread; its families are freed after it.

#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <apriltag/apriltag.h>
#include <apriltag/tag16h5.h>
#include <apriltag/tag25h9.h>
#include <apriltag/tag36h10.h>
#include <apriltag/tag36h11.h>
#include <apriltag/tagCircle21h7.h>
#include <apriltag/tagCircle49h12.h>
#include <apriltag/tagCustom48h12.h>
#include <apriltag/tagStandard41h12.h>
#include <apriltag/tagStandard52h13.h>

#define FAMILIES 9
#define MOST_BORDER_CELLS 2

static const struct {
    const char *name;
    apriltag_family_t *(*create)(void);
    void (*destroy)(apriltag_family_t *);
} KNOWN[FAMILIES] = {
    {"tag16h5", tag16h5_create, tag16h5_destroy},
    {"tag25h9", tag25h9_create, tag25h9_destroy},
    {"tag36h10", tag36h10_create, tag36h10_destroy},
    {"tag36h11", tag36h11_create, tag36h11_destroy},
    {"tagStandard41h12", tagStandard41h12_create, tagStandard41h12_destroy},
    {"tagStandard52h13", tagStandard52h13_create, tagStandard52h13_destroy},
    {"tagCircle21h7", tagCircle21h7_create, tagCircle21h7_destroy},
    {"tagCircle49h12", tagCircle49h12_create, tagCircle49h12_destroy},
    {"tagCustom48h12", tagCustom48h12_create, tagCustom48h12_destroy},
};

struct gnomon_detection {
    int32_t family; // in the order in which the families were added
    int32_t id;
    int32_t hamming;
    float margin;
    double corners[8]; // x, y of each corner, as libapriltag gives them
};

struct gnomon_apriltag {
    apriltag_detector_t *detector;
    apriltag_family_t *families[FAMILIES];
    int known[FAMILIES]; // index into KNOWN
    int family_count;
    struct gnomon_detection *found;
    size_t found_capacity;
    uint8_t *copy;
    size_t copy_capacity;
};

static int known_index(const char *name) {
    for (int k = 0; k < FAMILIES; k++)
        if (strcmp(KNOWN[k].name, name) == 0) return k;
    return -1;
}

// A family of the caller's own, with its codes moved into the middle of a border of so many cells.
static apriltag_family_t *create_family(int known, int32_t border_cells) {
    if (known < 0 || border_cells < 1 || border_cells > MOST_BORDER_CELLS) return NULL;
    apriltag_family_t *family = KNOWN[known].create();
    if (!family) return NULL;
    // The library's are printed with one cell; it counts the bits' places from the border's outer corner.
    uint32_t wider = (uint32_t)border_cells - 1;
    family->width_at_border += 2 * (int)wider;
    family->total_width += 2 * (int)wider;
    for (uint32_t bit = 0; bit < family->nbits; bit++) {
        family->bit_x[bit] += wider;
        family->bit_y[bit] += wider;
    }
    return family;
}

void gnomon_apriltag_destroy(struct gnomon_apriltag *self) {
    if (!self) return;
    if (self->detector) apriltag_detector_destroy(self->detector);
    for (int k = 0; k < self->family_count; k++) KNOWN[self->known[k]].destroy(self->families[k]);
    free(self->found);
    free(self->copy);
    free(self);
}

struct gnomon_apriltag *gnomon_apriltag_create(float decimation, float blur_px, bool refines_edges) {
    struct gnomon_apriltag *self = calloc(1, sizeof *self);
    if (!self) return NULL;
    self->detector = apriltag_detector_create();
    if (!self->detector) {
        gnomon_apriltag_destroy(self);
        return NULL;
    }
    self->detector->quad_decimate = decimation;
    self->detector->quad_sigma = blur_px;
    // The library refines every quadrilateral, marker or not; refine.rs those that decode.
    self->detector->refine_edges = refines_edges;
    // With more the library makes workers in the first search, which read its list of tasks while that is still being written
    // and jump to where it was: a crash in one of some hundred first searches.
    self->detector->nthreads = 1;
    return self;
}

bool gnomon_apriltag_add_family(struct gnomon_apriltag *self, const char *name, int32_t border_cells,
                                int32_t corrected_bits) {
    int k = known_index(name);
    if (self->family_count == FAMILIES) return false;
    apriltag_family_t *family = create_family(k, border_cells);
    if (!family) return false;
    self->families[self->family_count] = family;
    self->known[self->family_count] = k;
    self->family_count++;
    apriltag_detector_add_family_bits(self->detector, family, corrected_bits);
    return true;
}

// Returns the number of markers, -1 when memory ran out; `found` stays valid until the next call.
int32_t gnomon_apriltag_detect(struct gnomon_apriltag *self, const uint8_t *grey, int32_t width, int32_t height,
                               const struct gnomon_detection **found) {
    // Without decimation libapriltag blurs the picture that it was given.
    uint8_t *pixels = (uint8_t *)grey;
    if (self->detector->quad_decimate <= 1 && self->detector->quad_sigma != 0) {
        size_t size = (size_t)width * (size_t)height;
        if (size > self->copy_capacity) {
            uint8_t *grown = realloc(self->copy, size);
            if (!grown) return -1;
            self->copy = grown;
            self->copy_capacity = size;
        }
        memcpy(self->copy, grey, size);
        pixels = self->copy;
    }
    image_u8_t image = {.width = width, .height = height, .stride = width, .buf = pixels};
    zarray_t *detections = apriltag_detector_detect(self->detector, &image);
    if (!detections) return -1;

    size_t count = (size_t)zarray_size(detections);
    if (count > self->found_capacity) {
        struct gnomon_detection *grown = realloc(self->found, count * sizeof *grown);
        if (!grown) {
            apriltag_detections_destroy(detections);
            return -1;
        }
        self->found = grown;
        self->found_capacity = count;
    }
    for (size_t k = 0; k < count; k++) {
        apriltag_detection_t *detection;
        zarray_get(detections, (int)k, &detection);
        struct gnomon_detection *out = &self->found[k];
        out->family = -1;
        for (int f = 0; f < self->family_count; f++)
            if (self->families[f] == detection->family) out->family = f;
        out->id = detection->id;
        out->hamming = detection->hamming;
        out->margin = detection->decision_margin;
        for (int c = 0; c < 4; c++) {
            out->corners[2 * c] = detection->p[c][0];
            out->corners[2 * c + 1] = detection->p[c][1];
        }
    }
    apriltag_detections_destroy(detections);
    *found = self->found;
    return (int32_t)count;
}

// Writes the picture of a marker as printed, one byte a cell: 0 black, 1 white, 2 for what the family leaves open. With
// it comes what lies around the square whose corners are found: a white rim, or the codes around a ring.
// Returns the cells a side, or -1.
int32_t gnomon_apriltag_picture(const char *name, int32_t border_cells, uint32_t id, uint8_t *cells,
                                size_t capacity) {
    int k = known_index(name);
    apriltag_family_t *family = create_family(k, border_cells);
    if (!family) return -1;
    int32_t side = -1;
    image_u8_t *image = id < family->ncodes ? apriltag_to_image(family, (int)id) : NULL;
    if (image && image->width == image->height && (size_t)image->width * (size_t)image->height <= capacity) {
        side = image->width;
        // With a ring, the ring itself, the black around it and the bits are all that is laid down.
        int32_t beyond = (side - family->width_at_border) / 2;
        int32_t first = beyond - 1, last = side - beyond;
        for (int32_t y = 0; y < side; y++)
            for (int32_t x = 0; x < side; x++) {
                int32_t from_edge = x - first;
                if (y - first < from_edge) from_edge = y - first;
                if (last - x < from_edge) from_edge = last - x;
                if (last - y < from_edge) from_edge = last - y;
                bool is_laid_down = !family->reversed_border || from_edge == 0 || from_edge == 1;
                cells[y * side + x] = is_laid_down ? image->buf[y * image->stride + x] != 0 : 2;
            }
        for (uint32_t bit = 0; family->reversed_border && bit < family->nbits; bit++) {
            int32_t x = (int32_t)family->bit_x[bit] + beyond, y = (int32_t)family->bit_y[bit] + beyond;
            cells[y * side + x] = image->buf[y * image->stride + x] != 0;
        }
    }
    if (image) { // What image_u8_destroy does; Debian's library does not export it.
        free(image->buf);
        free(image);
    }
    KNOWN[k].destroy(family);
    return side;
}
