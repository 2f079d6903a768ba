/* The walk as one would write it in C: double precision, one photon after the other, the C
 * library's log, sin and cos. A half-space, Henyey and Greenstein, Fresnel, absorption along the
 * way, roulette, R(r) in 200 rings: what `montecarlo::scalar` does, without its generality.
 *
 * plain_walk SIGMA_A SIGMA_S G ETA PHOTONS prints nanoseconds per scattering and the reflectance. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static uint64_t state[4] = {0x9e3779b97f4a7c15, 0xbf58476d1ce4e5b9, 0x94d049bb133111eb, 1};

static uint64_t rotated(uint64_t x, int k) { return (x << k) | (x >> (64 - k)); }

/* xoshiro256+ (Blackman and Vigna 2021), in [0, 1). */
static double uniform(void) {
    uint64_t sum = state[0] + state[3], t = state[1] << 17;
    state[2] ^= state[0];
    state[3] ^= state[1];
    state[1] ^= state[2];
    state[0] ^= state[3];
    state[2] ^= t;
    state[3] = rotated(state[3], 45);
    return (double)(sum >> 11) * 0x1p-53;
}

/* Unpolarized, from inside; `eta` is the index inside over that outside. */
static double fresnel(double eta, double cos_in) {
    double sin2 = eta * eta * (1.0 - cos_in * cos_in);
    if (sin2 >= 1.0) return 1.0;
    double cos_out = sqrt(1.0 - sin2);
    double s = (eta * cos_in - cos_out) / (eta * cos_in + cos_out);
    double p = (cos_in - eta * cos_out) / (cos_in + eta * cos_out);
    return 0.5 * (s * s + p * p);
}

int main(int count, char **arguments) {
    if (count != 6) return 2;
    double sigma_a = atof(arguments[1]), sigma_s = atof(arguments[2]), g = atof(arguments[3]);
    double eta = atof(arguments[4]);
    long photons = atol(arguments[5]);
    const double two_pi = 6.283185307179586, width = 0.05;
    double rings[201] = {0};
    uint64_t events = 0;
    double specular = (eta - 1.0) / (eta + 1.0);
    specular *= specular;
    struct timespec start, end;
    clock_gettime(CLOCK_MONOTONIC, &start);
    for (long photon = 0; photon < photons; photon++) {
        double x = 0, y = 0, z = 0, ux = 0, uy = 0, uz = 1, weight = 1.0 - specular;
        for (;;) {
            double length = -log(1.0 - uniform()) / sigma_s;
            double to_top = uz < 0.0 ? -z / uz : INFINITY;
            if (length > to_top) {
                weight *= exp(-sigma_a * to_top);
                x += ux * to_top;
                y += uy * to_top;
                z = 0.0;
                if (uniform() < fresnel(eta, -uz)) {
                    uz = -uz;
                    continue;
                }
                int ring = (int)(sqrt(x * x + y * y) / width);
                rings[ring < 200 ? ring : 200] += weight;
                break;
            }
            weight *= exp(-sigma_a * length);
            x += ux * length;
            y += uy * length;
            z += uz * length;
            events++;
            double cos_theta = 2.0 * uniform() - 1.0;
            if (g != 0.0) {
                double t = (1.0 - g * g) / (1.0 + g * cos_theta);
                cos_theta = (1.0 + g * g - t * t) / (2.0 * g);
            }
            double sin_theta = sqrt(fmax(0.0, 1.0 - cos_theta * cos_theta));
            double phi = two_pi * uniform(), c = cos(phi), s = sin(phi);
            if (fabs(uz) > 0.99999) {
                ux = sin_theta * c;
                uy = sin_theta * s;
                uz = copysign(cos_theta, uz * cos_theta);
            } else {
                double across = sqrt(1.0 - uz * uz);
                double vx = sin_theta * (ux * uz * c - uy * s) / across + ux * cos_theta;
                double vy = sin_theta * (uy * uz * c + ux * s) / across + uy * cos_theta;
                uz = -sin_theta * c * across + uz * cos_theta;
                ux = vx;
                uy = vy;
            }
            if (weight < 1e-4) {
                if (uniform() >= 0.1) break;
                weight *= 10.0;
            }
        }
    }
    clock_gettime(CLOCK_MONOTONIC, &end);
    double seconds = (double)(end.tv_sec - start.tv_sec) + 1e-9 * (double)(end.tv_nsec - start.tv_nsec);
    double reflectance = 0;
    for (int ring = 0; ring <= 200; ring++) reflectance += rings[ring];
    printf("%f %f\n", 1e9 * seconds / (double)events, reflectance / (double)photons);
    return 0;
}
