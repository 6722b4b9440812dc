/* Linear responses along a course, of many columns of additions.
 *
 * x+ = transition x + driven[:, w] a,  y = shown x + direct[:, w] a  at each sample, where w is the
 * addition that a column makes and a its size, a value times an amount, which columns share. Columns
 * go in blocks that a cache holds.
 */
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

#define BLOCK 64

typedef struct {
    int n, nx, ny, nw, columns, stride, smooth;
    const double *transitions, *driven; /* (n - 1, nx, nx), (n - 1, nx, nw) */
    const double *shown, *direct;       /* (n, ny, nx), (n, ny, nw) */
    const double *start;                /* (nx, columns) */
    const double *values, *amounts;     /* rows of n */
    const int *addition, *value, *amount; /* of each column, and its rows of both */
    double *out;                        /* (columns, ny, samples), of every `stride` samples */
    ptrdiff_t of_column, of_output;     /* from a column and from an output to the next */
} responses;

/* out = matrix x + inputs[:, addition] a, of a block of columns */
static void multiply(const responses *r, int rows, const double *matrix, const double *inputs, int first, int width,
                     const double *x, const double *a, double *out) {
    for (int i = 0; i < rows; i++) {
        double *restrict o = out + i * BLOCK;
        for (int b = 0; b < width; b++) o[b] = inputs[i * r->nw + r->addition[first + b]] * a[b];
        for (int j = 0; j < r->nx; j++) {
            const double m = matrix[i * r->nx + j], *s = x + j * BLOCK;
            for (int b = 0; b < width; b++) o[b] += m * s[b];
        }
    }
}

/* sizes of a block of columns at a sample */
static void sizes_at(const responses *r, int k, int first, int width, double *a) {
    for (int b = 0; b < width; b++) {
        size_t value = (size_t)r->value[first + b] * r->n, amount = (size_t)r->amount[first + b] * r->n;
        a[b] = r->values[value + k] * r->amounts[amount + k];
    }
}

static void respond_block(const responses *r, int first, int width, double *x, double *next, double *y) {
    double here[BLOCK], ahead[BLOCK], between[BLOCK];
    for (int i = 0; i < r->nx; i++)
        for (int b = 0; b < width; b++) x[i * BLOCK + b] = r->start[i * r->columns + first + b];
    sizes_at(r, 0, first, width, ahead);
    for (int k = 0; k < r->n; k++) {
        memcpy(here, ahead, width * sizeof(double));
        if (k % r->stride == 0) {
            multiply(r, r->ny, r->shown + (size_t)k * r->ny * r->nx, r->direct + (size_t)k * r->ny * r->nw,
                     first, width, x, here, y);
            for (int b = 0; b < width; b++)
                for (int j = 0; j < r->ny; j++)
                    r->out[(first + b) * r->of_column + j * r->of_output + k / r->stride] = y[j * BLOCK + b];
        }
        if (k == r->n - 1) break;
        sizes_at(r, k + 1, first, width, ahead);
        for (int b = 0; b < width; b++) between[b] = r->smooth ? 0.5 * (here[b] + ahead[b]) : here[b];
        multiply(r, r->nx, r->transitions + (size_t)k * r->nx * r->nx, r->driven + (size_t)k * r->nx * r->nw,
                 first, width, x, between, next);
        double *old = x;
        x = next;
        next = old;
    }
}

/* Return 0, or -1 without memory. */
EXPORT int respond(const responses *r) {
    double *x = malloc((2 * r->nx + r->ny + 1) * BLOCK * sizeof(double));
    if (!x) return -1;
    for (int first = 0; first < r->columns; first += BLOCK) {
        int width = r->columns - first < BLOCK ? r->columns - first : BLOCK;
        respond_block(r, first, width, x, x + r->nx * BLOCK, x + 2 * r->nx * BLOCK);
    }
    free(x);
    return 0;
}
