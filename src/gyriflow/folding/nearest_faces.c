// Nearest of a few vertices; nearest of many triangles and vertices, eight at a time, by a tree of boxes around them.

#include <stdint.h>
#define W 8
#define DEPTH 64
#define ROUND_OFF (1 + 1e-12)
#define EACH for (int i = 0; i < 3; i++)

static inline double smaller(double a, double b) { return a < b ? a : b; }
static inline double larger(double a, double b) { return a > b ? a : b; }
static inline double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static inline double to_box(const double *p, const double (*box)[3]) {  // squared; box[0] is its low corner, box[1] high
    double sum = 0;
    EACH {
        double gap = larger(larger(box[0][i] - p[i], p[i] - box[1][i]), 0);
        sum += gap * gap;
    }
    return sum;
}

static inline double to_segment(const double *ap, const double *ab) {  // squared, from a point at ap to 0 ... ab
    double t = smaller(larger(dot(ap, ab) / dot(ab, ab), 0), 1), gap[3];
    EACH gap[i] = ap[i] - t * ab[i];
    return dot(gap, gap);
}

static inline double to_triangle(const double *p, const double *a, const double *b, const double *c) {  // squared
    double ab[3], ac[3], bc[3], ap[3], bp[3];
    EACH ab[i] = b[i] - a[i], ac[i] = c[i] - a[i], bc[i] = c[i] - b[i], ap[i] = p[i] - a[i], bp[i] = p[i] - b[i];
    double n[3] = {ab[1] * ac[2] - ab[2] * ac[1], ab[2] * ac[0] - ab[0] * ac[2], ab[0] * ac[1] - ab[1] * ac[0]};
    double nn = dot(n, n), aa = dot(ab, ab), cc = dot(ac, ac), a_c = dot(ab, ac), pb = dot(ap, ab), pc = dot(ap, ac);
    double of_b = cc * pb - a_c * pc, of_c = aa * pc - a_c * pb, height = dot(ap, n);  // barycentric, times nn
    double to_side = smaller(to_segment(ap, ab), smaller(to_segment(ap, ac), to_segment(bp, bc)));
    return (nn > 0) & (of_b >= 0) & (of_c >= 0) & (of_b + of_c <= nn) ? height * height / nn : to_side;
}

// Sets the nearest of each point's candidates among the vertices, and whether the square of the distance of another one
// is larger by at most this factor.
void nearest_candidates(long count, long width, double factor, const int64_t *candidates, const double (*points)[3],
                        const double (*vertices)[3], int64_t *nearest, int8_t *has_others) {
    for (long k = 0; k < count; k++) {
        const int64_t *candidate = candidates + k * width;
        double least = 0, squares[width];
        for (long c = 0; c < width; c++) {
            double gap[3];
            EACH gap[i] = vertices[candidate[c]][i] - points[k][i];
            squares[c] = dot(gap, gap);
            if (c == 0 || squares[c] < least) least = squares[c], nearest[k] = candidate[c];
        }
        has_others[k] = 0;
        for (long c = 0; c < width; c++) has_others[k] |= squares[c] <= factor * least && candidate[c] != nearest[k];
    }
}

// Sets for each point the squared distance of the nearest triangle, and the nearest vertex: of equally near ones the
// first. Box 1 contains all triangles, 2 k and 2 k + 1 are the halves of box k, and the last `leaves` boxes contain
// eight triangles each, with `corners` among the vertices.
void nearest_places(long count, long leaves, const double (*boxes)[2][3], const double (*triangles)[3][3][W],
                    const int64_t (*corners)[3][W], const double (*vertices)[3], const double (*points)[3],
                    double *squared, int64_t *nearest) {
    int64_t vertex = corners[0][0][0];
    for (long k = 0; k < count; k++) {
        // the last point is probably near, so that its vertex is a bound, but for round-off
        double gap[3], to_face, to_vertex, reach, own = 0, far[DEPTH];
        const double *p = points[k];
        EACH gap[i] = vertices[vertex][i] - p[i];
        to_face = to_vertex = ROUND_OFF * dot(gap, gap), reach = ROUND_OFF * to_vertex;
        long stack[DEPTH], top = 0, box = 1;
        while (box) {
            if (box < leaves) {
                double first = to_box(p, boxes[2 * box]), second = to_box(p, boxes[2 * box + 1]);
                long nearer = 2 * box + (second < first);
                if (larger(first, second) <= reach) far[top] = larger(first, second), stack[top++] = nearer ^ 1;
                if (smaller(first, second) <= reach) {
                    own = smaller(first, second), box = nearer;
                    continue;
                }
            } else {
                const double (*triangle)[3][W] = triangles[box - leaves];
                double found[3][W], least = to_vertex;
                for (int m = 0; m < 3; m++) for (int l = 0; l < W; l++) {
                    double x = triangle[m][0][l] - p[0], y = triangle[m][1][l] - p[1], z = triangle[m][2][l] - p[2];
                    found[m][l] = x * x + y * y + z * z;
                }
                for (int m = 0; m < 3; m++) for (int l = 0; l < W; l++) least = smaller(found[m][l], least);
                for (int m = 0; m < 3; m++) for (int l = 0; l < W; l++) {
                    int64_t corner = corners[box - leaves][m][l];
                    if (found[m][l] == least && (least < to_vertex || corner < vertex)) vertex = corner, to_vertex = least;
                }
                to_face = smaller(to_face, to_vertex), reach = ROUND_OFF * to_vertex;
                if (own < to_face) {
                    for (int l = 0; l < W; l++) {
                        double corner[3][3];
                        for (int m = 0; m < 3; m++) EACH corner[m][i] = triangle[m][i][l];
                        found[0][l] = to_triangle(p, corner[0], corner[1], corner[2]);
                    }
                    for (int l = 0; l < W; l++) to_face = smaller(found[0][l], to_face);
                }
            }
            for (box = 0; top && !box;) if (far[--top] <= reach) own = far[top], box = stack[top];
        }
        squared[k] = to_face, nearest[k] = vertex;
    }
}
