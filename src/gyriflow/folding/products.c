// Products with matrices of 3 x 3 blocks in single precision, for each iteration of conjugate gradients.

#include <stdint.h>
#include <string.h>
// four floats at once; the fourth is the first of the next row or is not used
typedef float v __attribute__((vector_size(16), aligned(4)));

void to_single_blocks(long count, const int32_t *entries, const double (*values)[9], float (*blocks)[9]) {
    for (long k = 0; k < count; k++) for (int i = 0; i < 9; i++) blocks[k][i] = values[entries[k]][i];
}

void to_single_vectors(long count, const double (*x)[3], float (*single)[4]) {
    for (long k = 0; k < count; k++) for (int i = 0; i < 3; i++) single[k][i] = x[k][i];
}

// y = A x of the owned rows; `sums` is work space, x has the ghosts behind the owned nodes
void multiply(long owned, const int32_t *ends, const int32_t *columns, const float (*blocks)[9],
              const float (*x)[4], float (*sums)[4], double (*y)[3]) {
    memset(sums, 0, owned * sizeof *sums);
    for (long i = 0; i < owned; i++) {
        v row[3] = {0}, xi = *(const v *)x[i];
        for (int32_t k = ends[i]; k < ends[i + 1]; k++) {
            long j = columns[k];
            const float *block = blocks[k];
            v a = *(const v *)block, b = *(const v *)(block + 3), c = *(const v *)(block + 6);
            v xj = *(const v *)x[j];
            row[0] += a * xj, row[1] += b * xj, row[2] += c * xj;
            // an off-diagonal block stands for its mirror image too, except in other ranks' columns
            if (j > i && j < owned) *(v *)sums[j] += a * xi[0] + b * xi[1] + c * xi[2];
        }
        for (int l = 0; l < 3; l++) sums[i][l] += row[l][0] + row[l][1] + row[l][2];
    }
    for (long i = 0; i < owned; i++) for (int l = 0; l < 3; l++) y[i][l] = sums[i][l];
}

// forces and torques on parts, from the forces x on nodes at `arms` from the parts' centres
void restrict_to_parts(long count, const int32_t *part, const float (*arms)[3], const double (*x)[3],
                       double (*loads)[6]) {
    for (long k = 0; k < count; k++) {
        const float *a = arms[k];
        const double *f = x[k];
        double *load = loads[part[k]];
        for (int i = 0; i < 3; i++) {
            int j = (i + 1) % 3, l = (i + 2) % 3;
            load[i] += f[i], load[3 + i] += a[j] * f[l] - a[l] * f[j];
        }
    }
}

// adds translations and rotations of the parts to the displacements y of the nodes
void add_motions(long count, const int32_t *part, const float (*arms)[3], const double (*motions)[6], double (*y)[3]) {
    for (long k = 0; k < count; k++) {
        const float *a = arms[k];
        const double *shift = motions[part[k]], *turn = shift + 3;
        for (int i = 0; i < 3; i++) {
            int j = (i + 1) % 3, l = (i + 2) % 3;
            y[k][i] += shift[i] + turn[j] * a[l] - turn[l] * a[j];
        }
    }
}

void multiply_blocks(long count, const float (*blocks)[3][3], const double (*x)[3], double (*y)[3]) {
    for (long k = 0; k < count; k++) for (int i = 0; i < 3; i++) {
        const float *row = blocks[k][i];
        y[k][i] = row[0] * x[k][0] + row[1] * x[k][1] + row[2] * x[k][2];
    }
}
