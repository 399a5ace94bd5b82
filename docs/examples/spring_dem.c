/* A DEM with contact springs as an engine of ninedisk, in C: cc -O2 -o spring_dem spring_dem.c -lm
   Then: ninedisk run binary-collision --engine-cmd ./spring_dem

   The physics is that of spring_dem.py; the first third reads JSON, for which C has nothing of its own. */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/* ---- JSON: a tree of values; lists and objects hold their entries in order ---- */

typedef struct Value {
  char kind, *text; /* kind: one of [ { " n (number) t f 0 (null); text of a string */
  double number;
  struct Value *first, *next;
  char *key;
} Value;

static char *at; /* the place in the text */

static void fail(const char *what) {
  fprintf(stderr, "spring_dem: %s\n", what);
  exit(1);
}

static char skip(void) {
  while (*at && strchr(" \t\r\n,:", *at)) at++;
  return *at;
}

static char *string(void) { /* escapes stay as they are: no name that matters here has any */
  char *begin = ++at;
  while (*at && *at != '"') at += *at == '\\' ? 2 : 1;
  if (!*at) fail("the request ends within a string");
  *at++ = 0;
  return begin;
}

static Value *value(void) {
  Value *v = calloc(1, sizeof *v), **tail = &v->first;
  if (!v) fail("out of memory");
  char c = skip();
  if (c == '[' || c == '{') {
    v->kind = *at++;
    while (skip() != ']' && *at != '}') {
      if (!*at) fail("the request was cut off");
      char *key = c == '{' ? string() : NULL;
      *tail = value();
      (*tail)->key = key;
      tail = &(*tail)->next;
    }
    at++;
  } else if (c == '"') {
    v->kind = '"', v->text = string();
  } else if (c == 't' || c == 'f' || c == 'n') {
    v->kind = c == 'n' ? 0 : c, at += c == 'f' ? 5 : 4;
  } else {
    char *end;
    v->kind = 'n', v->number = strtod(at, &end);
    if (end == at) fail("the request is not JSON");
    at = end;
  }
  return v;
}

static Value *get(const Value *v, const char *key) {
  for (Value *each = v->first; each; each = each->next)
    if (!strcmp(each->key, key)) return each;
  fail(key);
  return NULL;
}

static double number(const Value *v, const char *key) { return get(v, key)->number; }

static int count(const Value *v) {
  int n = 0;
  for (Value *each = v->first; each; each = each->next) n++;
  return n;
}

/* The numbers of nested lists, `width` to a row, in columns first .. of `out` with `stride`. */
static void read_rows(const Value *list, int width, int stride, int first, double *out) {
  int row = 0;
  for (Value *each = list->first; each; each = each->next, row++) {
    Value *part = width > 1 ? each->first : each;
    for (int k = 0; k < width; k++, part = part->next) out[row * stride + first + k] = part->kind == 't' ? 1.0 : part->number;
  }
}

/* ---- Physics ---- */

typedef struct {
  double kn, ks, mu, beta;
  int arm_overlap;
} Law;

typedef struct {
  Value *motion;
  double x[2], n[2], p[2], v[2]; /* p, v: where the wall is and how it moves now */
  Law law;
} Wall;

static Law read_law(const Value *v) {
  return (Law){number(v, "kn"), number(v, "ks"), number(v, "mu"), number(v, "beta"),
               !strcmp(get(v, "lever_arm")->text, "overlap")};
}

/* Where a wall is at t and its velocity at half; it moves along straight lines. */
static void place(Wall *w, double t, double half) {
  double begin = 0.0;
  memcpy(w->p, w->x, sizeof w->p), memset(w->v, 0, sizeof w->v);
  for (Value *s = w->motion->first; s; s = s->next) {
    Value *duration = get(s, "duration");
    double v[2], end = begin + (duration->kind == '"' ? INFINITY : duration->number), passed = fmax(0.0, fmin(t, end) - begin);
    read_rows(get(s, "velocity"), 1, 1, 0, v);
    for (int k = 0; k < 2; k++) {
      w->p[k] += v[k] * passed;
      if (begin <= half && half < end) w->v[k] = v[k];
    }
    begin = end;
  }
}

/* ---- The answer: arrays of text that grow, one a quantity ---- */

typedef struct {
  FILE *stream;
  char *text;
  size_t size;
} Series;

enum { STEP, T, X, V, ANGLE, OMEGA, GAP, FN, FS, WALL_POINT, WALL_ANGLE, WALL_FORCE, N_SERIES };
static const char *const NAMES[N_SERIES] = {"step", "t",  "x",  "v",          "angle",      "omega",
                                            "gap",  "fn", "fs", "wall_point", "wall_angle", "wall_force"};
static Series series[N_SERIES];

/* One sample: `rows` rows of `width` numbers; width 0 is a list of numbers, rows -1 a single number. */
static void sample(int which, int rows, int width, const double *data, int stride) {
  FILE *out = series[which].stream;
  if (ftell(out) > 0) fputc(',', out);
  if (rows < 0) {
    fprintf(out, "%.17g", *data);
    return;
  }
  fputc('[', out);
  for (int i = 0; i < rows; i++) {
    if (i) fputc(',', out);
    if (width) fprintf(out, "[%.17g,%.17g]", data[i * stride], data[i * stride + 1]);
    else fprintf(out, "%.17g", data[i * stride]);
  }
  fputc(']', out);
}

static void run(const Value *request) {
  const Value *scene = get(request, "scene"), *numerics = get(request, "numerics"), *disks = get(scene, "disks");
  int n = count(get(disks, "mass")), m = count(get(scene, "walls")), c = count(get(request, "watch")), all = n + m, index = 0;
  double *x = calloc(2 * n + 1, sizeof *x), *v = calloc(3 * n + 1, sizeof *v), *after = calloc(3 * n + 1, sizeof *v);
  double *now = calloc(3 * n + 1, sizeof *v), *R = calloc(n + 1, sizeof *R), *mass = calloc(n + 1, sizeof *R);
  double *inertia = calloc(n + 1, sizeof *R), *rotating = calloc(n + 1, sizeof *R), *angle = calloc(n + 1, sizeof *R);
  double *load = calloc(3 * all + 1, sizeof *load), *found = calloc(3 * all * all + 1, sizeof *found), g[2];
  double *watch = calloc(2 * c + 1, sizeof *watch), *seen = calloc(3 * c + 1, sizeof *seen);
  double *points = calloc(2 * m + 1, sizeof *points), *angles = calloc(m + 1, sizeof *angles);
  Wall *walls = calloc(m + 1, sizeof *walls);
  read_rows(get(disks, "x"), 2, 2, 0, x), read_rows(get(disks, "v"), 2, 3, 0, v), read_rows(get(disks, "omega"), 1, 3, 2, v);
  read_rows(get(disks, "radius"), 1, 1, 0, R), read_rows(get(disks, "mass"), 1, 1, 0, mass);
  read_rows(get(disks, "inertia"), 1, 1, 0, inertia), read_rows(get(disks, "rotating"), 1, 1, 0, rotating);
  read_rows(get(request, "watch"), 2, 2, 0, watch), read_rows(get(scene, "gravity"), 1, 1, 0, g);
  for (Value *w = get(scene, "walls")->first; w; w = w->next, index++) {
    walls[index].motion = get(w, "motion"), walls[index].law = read_law(get(w, "law"));
    read_rows(get(w, "point"), 1, 1, 0, walls[index].x), read_rows(get(w, "normal"), 1, 1, 0, walls[index].n);
    angles[index] = atan2(walls[index].n[1], walls[index].n[0]);
  }
  for (Value *s = get(scene, "initial_shear")->first; s; s = s->next) {
    double entry[3];
    read_rows(s, 1, 1, 0, entry);
    found[3 * ((int)entry[0] * all + (int)entry[1]) + 2] = entry[2];
  }
  Law between = read_law(get(scene, "disk_disk"));
  double dt = number(numerics, "contact_dt"), xi = number(scene, "xi"), a = 0.5 * xi * dt;
  int lagged = !strcmp(get(numerics, "damping_form")->text, "lagged");
  long substeps = lround(number(numerics, "dt") / dt), last = (long)number(numerics, "n_steps") * substeps;
  Value *wanted = get(request, "sampled_steps")->first;
  for (int k = 0; k < N_SERIES; k++) series[k].stream = open_memstream(&series[k].text, &series[k].size);

  for (long step = 0; step <= last; step++) {
    double t = step * dt;
    memset(load, 0, 3 * all * sizeof *load);
    for (int i = 0; i < n; i++) load[3 * i] = mass[i] * g[0], load[3 * i + 1] = mass[i] * g[1];
    for (int k = 0; k < m; k++) place(&walls[k], t, fmax(0.0, (step - 0.5) * dt));
    for (int i = 0; i < n; i++)
      for (int j = i + 1; j < all; j++) { /* forces at the positions of t_n; slips and dashpots see v of t_(n - 1/2) */
        const Wall *w = j < n ? NULL : &walls[j - n];
        const Law *law = w ? &w->law : &between;
        double nx, ny, gap, ux, uy, uw = 0.0, Rj = 0.0, inverse = 1.0 / mass[i], *pair = found + 3 * (i * all + j);
        if (w) {
          nx = -w->n[0], ny = -w->n[1], ux = w->v[0], uy = w->v[1];
          gap = (x[2 * i] - w->p[0]) * w->n[0] + (x[2 * i + 1] - w->p[1]) * w->n[1] - R[i];
        } else {
          double dx = x[2 * j] - x[2 * i], dy = x[2 * j + 1] - x[2 * i + 1], distance = hypot(dx, dy);
          nx = dx / distance, ny = dy / distance, gap = distance - R[i] - R[j];
          ux = v[3 * j], uy = v[3 * j + 1], uw = v[3 * j + 2], Rj = R[j], inverse += 1.0 / mass[j];
        }
        pair[0] = gap;
        if (gap >= 0.0) {
          pair[1] = pair[2] = 0.0;
          continue;
        }
        double closing = (v[3 * i] - ux) * nx + (v[3 * i + 1] - uy) * ny, less = law->arm_overlap ? -0.5 * gap : 0.0;
        double fn = fmax(0.0, 2.0 * law->beta * sqrt(law->kn / inverse) * closing - law->kn * gap), cap = law->mu * fn;
        double slip = (v[3 * i + 1] - uy) * nx - (v[3 * i] - ux) * ny + (R[i] - less) * v[3 * i + 2] + (Rj - less) * uw;
        double fs = fmax(-cap, fmin(cap, pair[2] - law->ks * (slip * (step ? dt : 0.0))));
        double fx = -fn * nx - fs * ny, fy = -fn * ny + fs * nx;
        pair[1] = fn, pair[2] = fs;
        load[3 * i] += fx, load[3 * i + 1] += fy, load[3 * i + 2] += (R[i] - less) * fs;
        load[3 * j] -= fx, load[3 * j + 1] -= fy, load[3 * j + 2] += (Rj - less) * fs;
      }
    double kept = step == 0 ? 1.0 - a : lagged ? 1.0 - xi * dt : (1.0 - a) / (1.0 + a);
    double gain = step == 0 ? 0.5 * dt : lagged ? dt : dt / (1.0 + a); /* the start is synchronised: half a step from t_0 */
    for (int i = 0; i < n; i++)
      for (int k = 0; k < 3; k++) {
        int free = k < 2 || rotating[i];
        after[3 * i + k] = free ? kept * v[3 * i + k] + gain * load[3 * i + k] / (k < 2 ? mass[i] : inertia[i]) : v[3 * i + k];
        now[3 * i + k] = step == 0 ? v[3 * i + k] : 0.5 * (v[3 * i + k] + after[3 * i + k]);
      }
    if (wanted && step == (long)wanted->number * substeps) {
      for (int k = 0; k < c; k++)
        memcpy(seen + 3 * k, found + 3 * ((int)watch[2 * k] * all + (int)watch[2 * k + 1]), 3 * sizeof *seen);
      for (int k = 0; k < m; k++) memcpy(points + 2 * k, walls[k].p, sizeof walls[k].p);
      sample(STEP, -1, 0, &wanted->number, 1), sample(T, -1, 0, &t, 1), sample(X, n, 2, x, 2), sample(V, n, 2, now, 3);
      sample(ANGLE, n, 0, angle, 1), sample(OMEGA, n, 0, now + 2, 3), sample(GAP, c, 0, seen, 3);
      sample(FN, c, 0, seen + 1, 3), sample(FS, c, 0, seen + 2, 3), sample(WALL_POINT, m, 2, points, 2);
      sample(WALL_ANGLE, m, 0, angles, 1), sample(WALL_FORCE, m, 2, load + 3 * n, 3);
      wanted = wanted->next;
    }
    memcpy(v, after, 3 * n * sizeof *v);
    for (int i = 0; i < n; i++) x[2 * i] += dt * v[3 * i], x[2 * i + 1] += dt * v[3 * i + 1], angle[i] += dt * v[3 * i + 2];
  }
}

int main(int argc, char **argv) {
  if (argc > 1 && !strcmp(argv[1], "describe")) {
    puts("{\"wire_version\": 1, \"id\": \"spring-dem-c\", \"version\": \"1.0\", \"contact\": \"spring\","
         " \"scheme\": \"central-difference\", \"capabilities\": [\"linear-contact\", \"shear-spring\", \"friction\","
         " \"contact-damping\", \"global-damping-central\", \"global-damping-lagged\", \"moving-walls\", \"gravity\","
         " \"blocked-rotation\", \"preload\", \"disk-inertia\", \"lever-arm-radius\", \"lever-arm-overlap\", \"slip-end\"]}");
    return 0;
  }
  size_t size = 0;
  ssize_t length = getdelim(&at, &size, 0, stdin);
  if (length <= 0) fail("there is no request on standard input");
  Value *request = value();
  clock_t begin = clock();
  run(request);
  printf("{\"wire_version\": 1, \"engine_version\": \"1.0\", \"timings\": {\"setup\": 0.0, \"warm_up\": 0.0, \"advance\": %.9f},",
         (double)(clock() - begin) / CLOCKS_PER_SEC);
  printf("\"settings\": {\"contact_dt [s]\": %.17g}, \"history\": {", number(get(request, "numerics"), "contact_dt"));
  for (int k = 0; k < N_SERIES; k++) {
    fclose(series[k].stream);
    printf("\"%s\": [%s],", NAMES[k], series[k].text);
  }
  puts("\"force_meaning\": \"instantaneous\", \"energy\": {}}}");
  return 0;
}
