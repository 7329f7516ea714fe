// Energy, forces and stiffness of linear elements, eight at a time. The law's energy density psi and its derivatives are
// functions of I1, J, mu and K that precede this file (mechanics/energy_code.py).
//
// With b = grad N . inverse(Fg) of the shape functions N, f = Fe b and c = C b, where C = dJ/dFe are the cofactors of
// Fe, forces are 2 psi_I f + psi_J c per volume. Stiffness is their derivative; that of C is (C x C - the same with two
// indices exchanged) / J.
#include <math.h>
#include <stdint.h>
#define W 8
#define EACH(i, n) for (int i = 0; i < n; i++)
typedef double v __attribute__((vector_size(8 * W)));

static inline v dot(const v *p, const v *q) { return p[0] * q[0] + p[1] * q[1] + p[2] * q[2]; }

static inline v cofactors(v m[3][3], v c[3][3]) {  // returns the determinant
    EACH(i, 3) EACH(j, 3) {
        int k = (i + 1) % 3, l = (i + 2) % 3, p = (j + 1) % 3, q = (j + 2) % 3;
        c[i][j] = m[k][p] * m[l][q] - m[k][q] * m[l][p];
    }
    return dot(m[0], c[0]);
}

// Returns the energy of `count` elements, sets `range` to their smallest and largest det F (NaN if one is), and adds
// their forces and stiffness unless these are NULL. Nodes have (., 3)
// positions X, displacements u and forces; elements have nodes `cells` (., 4), the inverse growth tensor, the shear
// modulus, and the `places` (., 4, 4) of their pairs of nodes among the blocks (., 3, 3), negative where there is none.
double assemble(long count, double bulk_to_shear, const int32_t (*cells)[4], const double (*X)[3],
                const double (*u)[3], const double (*G_inverse)[3][3], const double *mu,
                double *range, double (*forces)[3], const int32_t (*places)[4][4], double (*blocks)[3][3]) {
    double energy = 0;
    range[0] = INFINITY, range[1] = -INFINITY;
    for (long first = 0; first < count; first += W) {
        int lanes = count - first < W ? count - first : W;
        v edge[3][3], move[3][3], normal[3][3], G[3][3], F[3][3], C[3][3];
        v b[4][3], f[4][3], c[4][3], of_I, of_J, of_II, of_IJ, of_JJ;
        EACH(l, W) {
            long e = first + (l < lanes ? l : 0);
            const int32_t *n = cells[e];
            EACH(a, 3) EACH(i, 3) {
                edge[a][i][l] = X[n[a + 1]][i] - X[n[0]][i];
                move[a][i][l] = u[n[a + 1]][i] - u[n[0]][i];
                G[a][i][l] = G_inverse[e][a][i];
            }
        }
        // the blocks arrive while all else is computed
        if (blocks) EACH(l, lanes) EACH(a, 4) for (int d = a; d < 4; d++) {
            int32_t upper = places[first + l][a][d], mirrored = places[first + l][d][a];
            const char *block = (const char *)blocks[upper >= 0 ? upper : mirrored];
            __builtin_prefetch(block, 1), __builtin_prefetch(block + 64, 1);
        }
        v six = cofactors(edge, normal);
        EACH(a, 3) EACH(j, 3)
            b[a + 1][j] = (normal[a][0] * G[0][j] + normal[a][1] * G[1][j] + normal[a][2] * G[2][j]) / six;
        EACH(j, 3) b[0][j] = -(b[1][j] + b[2][j] + b[3][j]);
        EACH(i, 3) EACH(j, 3) F[i][j] = G[i][j] + move[0][i] * b[1][j] + move[1][i] * b[2][j] + move[2][i] * b[3][j];
        v J = cofactors(F, C), ratio = J / cofactors(G, normal), I1 = dot(F[0], F[0]) + dot(F[1], F[1]) + dot(F[2], F[2]);
        EACH(l, lanes) {
            double V = fabs(six[l]) / 6, m = mu[first + l], K = bulk_to_shear * m;
            energy += V * psi(I1[l], J[l], m, K);
            if (!(ratio[l] >= range[0])) range[0] = range[0] != range[0] ? range[0] : ratio[l];
            if (!(ratio[l] <= range[1])) range[1] = range[1] != range[1] ? range[1] : ratio[l];
            of_I[l] = V * psi_I(I1[l], J[l], m, K);
            of_J[l] = V * psi_J(I1[l], J[l], m, K);
            if (!blocks) continue;
            of_II[l] = V * psi_II(I1[l], J[l], m, K);
            of_IJ[l] = V * psi_IJ(I1[l], J[l], m, K);
            of_JJ[l] = V * psi_JJ(I1[l], J[l], m, K);
        }
        EACH(a, 4) EACH(i, 3) f[a][i] = dot(F[i], b[a]), c[a][i] = dot(C[i], b[a]);
        if (forces) EACH(a, 4) EACH(i, 3) {
            v force = 2 * of_I * f[a][i] + of_J * c[a][i];
            EACH(l, lanes) forces[cells[first + l][a]][i] += force[l];
        }
        if (blocks) EACH(a, 4) for (int d = a; d < 4; d++) {
            v K[3][3], exchanged = of_J / J;
            EACH(i, 3) EACH(j, 3)
                K[i][j] = f[a][i] * (4 * of_II * f[d][j] + 2 * of_IJ * c[d][j])
                    + c[a][i] * (2 * of_IJ * f[d][j] + (of_JJ + exchanged) * c[d][j]) - exchanged * c[d][i] * c[a][j];
            EACH(i, 3) K[i][i] += 2 * of_I * dot(b[a], b[d]);
            EACH(l, lanes) {
                int32_t upper = places[first + l][a][d], mirrored = places[first + l][d][a];
                if (upper >= 0) EACH(i, 3) EACH(j, 3) blocks[upper][i][j] += K[i][j][l];
                if (a != d && mirrored >= 0) EACH(i, 3) EACH(j, 3) blocks[mirrored][j][i] += K[i][j][l];
            }
        }
    }
    return energy;
}
