// The stretches and rotations of tetrahedra, and their stiffness to diffusion.

#include <math.h>
#include <stdint.h>
#define EACH(i, n) for (int i = 0; i < n; i++)

static void cross(const double *a, const double *b, double *c) {
    EACH(i, 3) c[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

static double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

// Of `count` elements between vertices at X before and x after: adds V/4 ln U (xx yy zz xy xz yz) and V/4 to the `sums`
// (., 7) of their corners, and sets their F in `gradients` (., 3, 3) and V grad Ni . grad Nj in `pairs` (., 6). Six terms
// of the series of ln(1 + x) give the logarithm to 3e-8 where the largest eigenvalue of FtF - 1 is 0.12. Where its bound,
// the sum of a row's absolute entries, is not `small`, the element is left out of the sums and `large` (.,) is set to 1.
void stretch(long count, double small, const int64_t (*tets)[4], const double (*X)[3], const double (*x)[3],
             double (*sums)[7], double (*pairs)[6], double (*gradients)[3][3], uint8_t *large) {
    for (long e = 0; e < count; e++) {
        const int64_t *n = tets[e];
        double edge[3][3], slope[4][3], F[3][3] = {0}, E[3][3], log[3][3], next[3][3], largest = 0;
        EACH(a, 3) EACH(i, 3) edge[a][i] = X[n[a + 1]][i] - X[n[0]][i];
        EACH(a, 3) cross(edge[(a + 1) % 3], edge[(a + 2) % 3], slope[a + 1]);
        double six = dot(edge[0], slope[1]), volume = six / 6;
        EACH(a, 3) EACH(i, 3) slope[a + 1][i] /= six;
        EACH(i, 3) slope[0][i] = -(slope[1][i] + slope[2][i] + slope[3][i]);
        for (int a = 0, k = 0; a < 4; a++)
            for (int b = a + 1; b < 4; b++) pairs[e][k++] = volume * dot(slope[a], slope[b]);
        EACH(a, 3) EACH(i, 3) EACH(j, 3) F[i][j] += (x[n[a + 1]][i] - x[n[0]][i]) * slope[a + 1][j];
        EACH(i, 3) EACH(j, 3) {
            gradients[e][i][j] = F[i][j];
            E[i][j] = F[0][i] * F[0][j] + F[1][i] * F[1][j] + F[2][i] * F[2][j] - (i == j);
            log[i][j] = (i == j) / 6.0;
        }
        EACH(i, 3) largest = fmax(largest, fabs(E[i][0]) + fabs(E[i][1]) + fabs(E[i][2]));
        for (int order = 5; order >= 0; order--) {
            EACH(i, 3) EACH(j, 3) next[i][j] = E[i][0] * log[0][j] + E[i][1] * log[1][j] + E[i][2] * log[2][j];
            EACH(i, 3) EACH(j, 3) log[i][j] = order ? (i == j) / (double)order - next[i][j] : next[i][j] / 2;
        }
        large[e] = !(largest <= small);
        double share = large[e] ? 0 : volume / 4;
        double share_of_corner[7] = {share * log[0][0], share * log[1][1], share * log[2][2],
                               share * log[0][1], share * log[0][2], share * log[1][2], volume / 4};
        EACH(a, 4) EACH(i, 7) sums[n[a]][i] += share_of_corner[i];
    }
}

// Adds V/4 times the axial vector of F and V/4 to the `sums` (., 4) of the corners of `count` elements.
void rotation(long count, const int64_t (*tets)[4], const double (*X)[3], const double (*x)[3], double (*sums)[4]) {
    for (long e = 0; e < count; e++) {
        const int64_t *n = tets[e];
        double edge[3][3], moved[3], slope[3], axial[3] = {0}, turned[3];
        EACH(a, 3) EACH(i, 3) edge[a][i] = X[n[a + 1]][i] - X[n[0]][i];
        cross(edge[1], edge[2], slope);
        double volume = dot(edge[0], slope) / 6;
        // half of the curl of x, times the volume
        EACH(a, 3) {
            cross(edge[(a + 1) % 3], edge[(a + 2) % 3], slope);
            EACH(i, 3) moved[i] = x[n[a + 1]][i] - x[n[0]][i];
            cross(slope, moved, turned);
            EACH(i, 3) axial[i] += turned[i] / 12;
        }
        double share_of_corner[4] = {axial[0] / 4, axial[1] / 4, axial[2] / 4, volume / 4};
        EACH(a, 4) EACH(i, 4) sums[n[a]][i] += share_of_corner[i];
    }
}
