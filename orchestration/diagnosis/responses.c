/* Linear responses along a course, of many columns of additions.
 *
 * x+ = transition x + driven[:, w] a,  y = shown x + direct[:, w] a  at each sample, where a is the
 * value of a column and w the addition that it makes. Columns go in blocks that a cache holds.
 */
#include <stddef.h>
#include <stdlib.h>

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
    const double *values;               /* (columns, n), a column after `lead` values */
    const int *addition;                /* (columns,) */
    double *out;                        /* (columns, ny, samples), of every `stride` samples */
    ptrdiff_t lead, of_column, of_output; /* from a column of values, of `out`, and an output to the next */
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

static void respond_block(const responses *r, int first, int width, double *x, double *next, double *y) {
    double here[BLOCK], between[BLOCK];
    for (int i = 0; i < r->nx; i++)
        for (int b = 0; b < width; b++) x[i * BLOCK + b] = r->start[i * r->columns + first + b];
    for (int k = 0; k < r->n; k++) {
        const double *values = r->values + first * r->lead + k;
        for (int b = 0; b < width; b++) here[b] = values[b * r->lead];
        if (k % r->stride == 0) {
            multiply(r, r->ny, r->shown + (size_t)k * r->ny * r->nx, r->direct + (size_t)k * r->ny * r->nw,
                     first, width, x, here, y);
            for (int b = 0; b < width; b++)
                for (int j = 0; j < r->ny; j++)
                    r->out[(first + b) * r->of_column + j * r->of_output + k / r->stride] = y[j * BLOCK + b];
        }
        if (k == r->n - 1) break;
        for (int b = 0; b < width; b++)
            between[b] = r->smooth ? 0.5 * (here[b] + values[b * r->lead + 1]) : here[b];
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
