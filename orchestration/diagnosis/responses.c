/* Linear responses along a course, of many columns of additions, and the gains of Kalman filters there.
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

/* out = a b, of which b is transposed if so asked: (rows, inner) times (inner, columns) */
static void product(int rows, int inner, int columns, const double *a, const double *b, int transposed, double *out) {
    for (int i = 0; i < rows; i++)
        for (int j = 0; j < columns; j++) {
            double sum = 0.0;
            for (int l = 0; l < inner; l++) sum += a[i * inner + l] * (transposed ? b[j * inner + l] : b[l * columns + j]);
            out[i * columns + j] = sum;
        }
}

/* Solve a x = b (m, columns) in place, for a positive definite matrix a (m, m). */
static void solve(int m, int columns, double *a, double *b) {
    for (int i = 0; i < m; i++)
        for (int j = i + 1; j < m; j++) {
            double by = a[j * m + i] / a[i * m + i];
            for (int l = i; l < m; l++) a[j * m + l] -= by * a[i * m + l];
            for (int l = 0; l < columns; l++) b[j * columns + l] -= by * b[i * columns + l];
        }
    for (int i = m - 1; i >= 0; i--)
        for (int l = 0; l < columns; l++) {
            for (int j = i + 1; j < m; j++) b[i * columns + l] -= a[i * m + j] * b[j * columns + l];
            b[i * columns + l] /= a[i * m + i];
        }
}

/* Gains (n, nx, ny) of a Kalman filter, zero of outputs (n, ny) that are not measured. Disturbances
 * push the states, (n - 1, nx, nw); outputs have white noise of a variance each. Returns 0, or -1 without memory. */
EXPORT int gains(int n, int nx, int ny, int nw, const double *start, const double *transitions, const double *shown,
                 const double *pushes, const double *variance, const unsigned char *measured, double *out) {
    double *P = malloc((5 * nx * nx + 4 * nx * ny + ny * ny) * sizeof(double));
    if (!P) return -1;
    double *rest = P + nx * nx, *left = rest + nx * nx, *part = left + nx * nx, *pushed = part + nx * nx;
    double *H = pushed + nx * nx, *across = H + nx * ny, *gain = across + nx * ny, *noisy = gain + nx * ny;
    double *S = noisy + nx * ny;
    memcpy(P, start, nx * nx * sizeof(double));
    for (int k = 0; k < n; k++) {
        int m = 0;
        for (int j = 0; j < ny; j++)
            if (measured[(size_t)k * ny + j]) memcpy(H + nx * m++, shown + ((size_t)k * ny + j) * nx, nx * sizeof(double));
        product(m, nx, nx, H, P, 0, across);
        product(m, nx, m, across, H, 1, S);
        for (int j = 0, i = 0; j < ny; j++)
            if (measured[(size_t)k * ny + j]) { S[i * m + i] += variance[j]; i++; }
        solve(m, nx, S, across);
        for (int j = 0, i = 0; j < ny; j++)
            if (measured[(size_t)k * ny + j]) {
                for (int l = 0; l < nx; l++) {
                    gain[l * m + i] = across[i * nx + l];
                    noisy[l * m + i] = gain[l * m + i] * variance[j];
                    out[((size_t)k * nx + l) * ny + j] = gain[l * m + i];
                }
                i++;
            }
        if (k == n - 1) break;
        /* Joseph's form: it stays positive */
        product(nx, m, nx, gain, H, 0, rest);
        for (int i = 0; i < nx * nx; i++) rest[i] = (i % (nx + 1) ? 0.0 : 1.0) - rest[i];
        product(nx, nx, nx, rest, P, 0, part);
        product(nx, nx, nx, part, rest, 1, left);
        product(nx, m, nx, noisy, gain, 1, part);
        for (int i = 0; i < nx * nx; i++) left[i] += part[i];
        const double *push = pushes + (size_t)k * nx * nw;
        product(nx, nw, nx, push, push, 1, pushed);
        const double *step = transitions + (size_t)k * nx * nx;
        product(nx, nx, nx, step, left, 0, part);
        product(nx, nx, nx, part, step, 1, P);
        for (int i = 0; i < nx * nx; i++) P[i] += pushed[i];
    }
    free(P);
    return 0;
}
