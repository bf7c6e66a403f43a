/* The arm of robots/vsa_3r.yaml under its generated controller, one call a millisecond.

   The robot is stepped here as well, in place of a real one: its mass matrix and velocity terms come from the
   generated link torques, its springs and motors are written down below. It starts 0.02 rad beside the command. */

#include "vsa_3r.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { N = VSA_3R_JOINTS, STATES = 6 * N };

static const double PERIOD = 1e-3;   /* s, of the controller */
static const double DURATION = 2.0;  /* s, of the motion; the reference rests afterwards */
static const double START[3] = {0, 0, 0}, END[3] = {1.5707963267948966, 0.7853981633974483, -1.0471975511965976};
static const double SOFT = 850, STIFF = 1275; /* N m/rad */

static const double MOTOR_INERTIA[3] = {3.20, 3.05, 1.98}, MOTOR_DAMPING = 1e-4; /* kg m^2, N m s/rad */

/* The springs of Table I: torque and stiffness at a deflection. */
static double spring_torque(double phi) { return 400 * phi + 2000 * phi * phi * phi; }
static double spring_stiffness(double phi) { return 400 + 6000 * phi * phi; }

/* The reference */

/* A polynomial's value and derivatives with respect to time, x = t / DURATION held to 0..1. */
static void polynomial(const double *coefficients, int degree, double t, int orders, double *result)
{
    const double x = t < DURATION ? t / DURATION : 1;
    double c[10], scale = 1;
    memcpy(c, coefficients, sizeof(double) * (size_t)(degree + 1));
    for (int order = 0; order < orders; order++) {
        double value = 0;
        for (int power = degree - order; power >= 0; power--)
            value = value * x + c[power];
        result[order] = value * scale;
        for (int power = 0; power < degree - order; power++)
            c[power] = (power + 1) * c[power + 1];
        scale /= DURATION;
    }
}

/* From rest to rest; the fourth derivative of the position and the second of the stiffness are continuous. */
static void reference(double t, vsa_3r_command *command)
{
    static const double nine[10] = {0, 0, 0, 0, 0, 126, -420, 540, -315, 70}, five[6] = {0, 0, 0, 10, -15, 6};
    double s[5], r[3];
    polynomial(nine, 9, t, 5, s);
    polynomial(five, 5, t, 3, r);
    for (int j = 0; j < N; j++) {
        const double span = END[j] - START[j];
        command->q[j] = START[j] + span * s[0];
        command->dq[j] = span * s[1];
        command->ddq[j] = span * s[2];
        command->d3q[j] = span * s[3];
        command->d4q[j] = span * s[4];
        command->stiffness[j] = SOFT + (STIFF - SOFT) * r[0];
        command->dstiffness[j] = (STIFF - SOFT) * r[1];
        command->ddstiffness[j] = (STIFF - SOFT) * r[2];
    }
}

/* The robot: x = (q, dq, theta, dtheta) */

/* Solve a x = b by elimination; a mass matrix needs no pivoting. */
static void solve(double a[N][N], double b[N])
{
    for (int k = 0; k < N; k++)
        for (int i = k + 1; i < N; i++) {
            const double factor = a[i][k] / a[k][k];
            for (int j = k; j < N; j++)
                a[i][j] -= factor * a[k][j];
            b[i] -= factor * b[k];
        }
    for (int i = N - 1; i >= 0; i--) {
        for (int j = i + 1; j < N; j++)
            b[i] -= a[i][j] * b[j];
        b[i] /= a[i][i];
    }
}

static void derivative(const double *x, double tau[N][2], double *dx)
{
    const double *q = x, *dq = x + N, *theta = x + 2 * N, *dtheta = x + 4 * N;
    vsa_3r_motion motion = {.q = {0}};
    vsa_3r_torques bias, column;
    double mass[N][N], ddq[N];
    memcpy(motion.q, q, sizeof motion.q);
    memcpy(motion.dq, dq, sizeof motion.dq);
    vsa_3r_link_torques(&motion, &bias);
    for (int j = 0; j < N; j++) {
        motion.ddq[j] = 1;
        vsa_3r_link_torques(&motion, &column);
        for (int i = 0; i < N; i++)
            mass[i][j] = column.tau_e[i] - bias.tau_e[i];
        motion.ddq[j] = 0;
    }
    for (int j = 0; j < N; j++) {
        ddq[j] = -bias.tau_e[j];
        for (int m = 0; m < 2; m++) {
            const double spring = spring_torque(theta[2 * j + m] - q[j]);
            ddq[j] += spring;
            dx[2 * N + 2 * j + m] = dtheta[2 * j + m];
            dx[4 * N + 2 * j + m] = (tau[j][m] - MOTOR_DAMPING * dtheta[2 * j + m] - spring) / MOTOR_INERTIA[j];
        }
    }
    solve(mass, ddq);
    memcpy(dx, dq, sizeof(double) * N);
    memcpy(dx + N, ddq, sizeof ddq);
}

/* One period under constant torques, by the classical Runge-Kutta method. */
static void step(double *x, double tau[N][2], double h)
{
    static const double part[4] = {0, 0.5, 0.5, 1}, weight[4] = {1, 2, 2, 1};
    double sum[STATES] = {0}, k[STATES] = {0}, at[STATES];
    for (int stage = 0; stage < 4; stage++) {
        for (int i = 0; i < STATES; i++)
            at[i] = x[i] + part[stage] * h * k[i];
        derivative(at, tau, k);
        for (int i = 0; i < STATES; i++)
            sum[i] += weight[stage] / 6 * k[i];
    }
    for (int i = 0; i < STATES; i++)
        x[i] += h * sum[i];
}

/* The controller */

static vsa_3r_gains four_poles_at(double pole)
{
    vsa_3r_gains gains = {.position_integral = {0}};
    for (int j = 0; j < N; j++) {
        const double p = -pole;
        gains.position[j][0] = p * p * p * p;
        gains.position[j][1] = 4 * p * p * p;
        gains.position[j][2] = 6 * p * p;
        gains.position[j][3] = 4 * p;
        gains.stiffness[j][0] = p * p;
        gains.stiffness[j][1] = 2 * p;
    }
    return gains;
}

/* Motors stand where the inverse dynamics of the reference's start wants them, shifted with the links. */
static unsigned start(double *x, double error)
{
    vsa_3r_command command;
    vsa_3r_drive drive;
    reference(0, &command);
    const unsigned flags = vsa_3r_inverse_dynamics(&command, &drive);
    for (int j = 0; j < N; j++) {
        x[j] = command.q[j] + error;
        x[N + j] = 0;
        for (int m = 0; m < 2; m++) {
            x[2 * N + 2 * j + m] = drive.theta[j][m] + error;
            x[4 * N + 2 * j + m] = 0;
        }
    }
    return flags;
}

static void report(double t, const double *x, const vsa_3r_command *command)
{
    double position = 0, stiffness = 0;
    for (int j = 0; j < N; j++) {
        const double *theta = x + 2 * N + 2 * j;
        const double sigma = spring_stiffness(theta[0] - x[j]) + spring_stiffness(theta[1] - x[j]);
        position = fmax(position, fabs(x[j] - command->q[j]));
        stiffness = fmax(stiffness, fabs(sigma - command->stiffness[j]));
    }
    printf("t = %.2f s: largest error %.5f rad, %.2f N m/rad\n", t, position, stiffness);
}

int main(void)
{
    const vsa_3r_gains gains = four_poles_at(-20);
    const vsa_3r_integral none = {.q = {0}};
    double x[STATES];
    if (start(x, 0.02))
        return 2;
    for (long k = 0; k <= 2500; k++) {
        const double t = (double)k * PERIOD;
        vsa_3r_command command;
        vsa_3r_state state;
        vsa_3r_control control;
        reference(t, &command);
        if (k % 500 == 0)
            report(t, x, &command);
        memcpy(state.q, x, sizeof state.q); /* a real controller reads its encoders here */
        memcpy(state.dq, x + N, sizeof state.dq);
        memcpy(state.theta, x + 2 * N, sizeof state.theta);
        memcpy(state.dtheta, x + 4 * N, sizeof state.dtheta);
        if (vsa_3r_feedback_linearization(&state, &command, &gains, &none, &control) & VSA_3R_SINGULAR) {
            printf("t = %.3f s: singular, stopping\n", t);
            return 3;
        }
        step(x, control.tau_motor, PERIOD);
    }
    return 0;
}
