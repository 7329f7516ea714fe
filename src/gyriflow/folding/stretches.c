// Deformation gradients of elements, and their inverses.

#include <math.h>
#include <stdint.h>
#define EACH(i) for (int i = 0; i < 3; i++)

static inline double cofactors(const double m[3][3], double c[3][3]) {  // returns the determinant
    EACH(i) EACH(j) {
        int k = (i + 1) % 3, l = (i + 2) % 3, p = (j + 1) % 3, q = (j + 2) % 3;
        c[i][j] = m[k][p] * m[l][q] - m[k][q] * m[l][p];
    }
    return m[0][0] * c[0][0] + m[0][1] * c[0][1] + m[0][2] * c[0][2];
}

// Sets F (., points) of elements with `nodes` nodes, from the slopes (points, nodes, 3) of their shape functions in the
// regular element. Rows of the maps between are axes of that element.
void deformations(long count, long points, long nodes, const int32_t *cells, const double (*before)[3],
                  const double (*after)[3], const double (*slopes)[3], double (*F)[3][3]) {
    for (long e = 0; e < count; e++, cells += nodes) for (long q = 0; q < points; q++, F++) {
        double first[3][3] = {{0}}, last[3][3] = {{0}}, c[3][3];
        for (long n = 0; n < nodes; n++) EACH(a) EACH(i) {
            double slope = slopes[q * nodes + n][a];
            first[a][i] += slope * before[cells[n]][i], last[a][i] += slope * after[cells[n]][i];
        }
        double volume = cofactors(first, c);
        EACH(i) EACH(j) F[0][i][j] = (last[0][i] * c[0][j] + last[1][i] * c[1][j] + last[2][i] * c[2][j]) / volume;
    }
}

// Sets inverses, or cofactors of singular matrices, and norms of F'F - 1.
void inverses_and_strains(long count, const double (*F)[3][3], double (*inverse)[3][3], double *strains) {
    for (long e = 0; e < count; e++) {
        double c[3][3], volume = cofactors(F[e], c), sum = 0;
        EACH(i) EACH(j) {
            double product = F[e][0][i] * F[e][0][j] + F[e][1][i] * F[e][1][j] + F[e][2][i] * F[e][2][j] - (i == j);
            inverse[e][i][j] = c[j][i] / (volume ? volume : 1), sum += product * product;
        }
        strains[e] = sqrt(sum);
    }
}
