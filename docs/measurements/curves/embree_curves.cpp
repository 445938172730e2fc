// Time and memory of Embree's own curves, single rays: curves as those of many.py as flat Bézier curves ("flat"), or as
// eight round cones each ("cones").
// g++ -O3 embree_curves.cpp -o embree_curves -lembree3 && ./embree_curves flat 100000
#include <embree3/rtcore.h>

#include <atomic>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <random>
#include <string>
#include <vector>

struct Vertex { float p[3], radius; };
struct Curve { Vertex v[4]; };

static std::vector<Curve> curves;
static std::atomic<long> bytes;

static bool count(void*, ssize_t change, bool) { bytes += change; return true; }
static double cpu() { timespec t; clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t); return t.tv_sec + 1e-9 * t.tv_nsec; }

static Vertex at(const Curve& c, float u) {
    float w = 1 - u, b[4] = {w * w * w, 3 * w * w * u, 3 * w * u * u, u * u * u};
    Vertex r{{0, 0, 0}, c.v[0].radius * w + c.v[3].radius * u};
    for (int k = 0; k < 4; k++) for (int i = 0; i < 3; i++) r.p[i] += b[k] * c.v[k].p[i];
    return r;
}

static std::mt19937 generator(1);
static float uniform(float a, float b) { return a + (b - a) * (generator() / 4294967296.0f); }
static void sphere(float* d) {
    float z = uniform(-1, 1), a = uniform(0, 6.2831853f), r = std::sqrt(1 - z * z);
    d[0] = r * std::cos(a), d[1] = r * std::sin(a), d[2] = z;
}

int main(int, char** argv) {
    std::string kind = argv[1];
    curves.resize(atoi(argv[2]));
    for (Curve& c : curves) {
        float n[3], bend[3];
        sphere(n);
        for (float& b : bend) b = uniform(-0.06f, 0.06f);
        for (int k = 0; k < 4; k++) {
            for (int i = 0; i < 3; i++) c.v[k].p[i] = n[i] * (1 + 0.1f * k) + bend[i] * k * k / 9;
            c.v[k].radius = 0.5f * (0.004f - 0.001f * k);
        }
    }

    // The scene
    std::vector<Vertex> vertices;
    std::vector<unsigned> indices;
    RTCDevice device = rtcNewDevice("");
    rtcSetDeviceMemoryMonitorFunction(device, count, nullptr);
    double start = cpu();
    RTCScene scene = rtcNewScene(device);
    rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
    bool flat = kind == "flat";
    RTCGeometryType type = flat ? RTC_GEOMETRY_TYPE_FLAT_BEZIER_CURVE : RTC_GEOMETRY_TYPE_ROUND_LINEAR_CURVE;
    RTCGeometry geometry = rtcNewGeometry(device, type);
    for (const Curve& c : curves) {
        for (int k = 0; k < (flat ? 4 : 9); k++) {
            if (flat ? k == 0 : k < 8) indices.push_back(vertices.size());
            vertices.push_back(flat ? c.v[k] : at(c, k / 8.f));
        }
    }
    // Padding
    vertices.push_back({});
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, vertices.data(), 0, 16,
                               vertices.size() - 1);
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT, indices.data(), 0, 4,
                               indices.size());
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    rtcCommitScene(scene);
    double buffers = double(vertices.size() * 16 + indices.size() * 4) / curves.size();
    printf("%s: build %.2f CPU s, %.0f bytes per curve and %.0f of buffers\n", argv[1], cpu() - start,
           double(bytes) / curves.size(), buffers);

    // Camera rays in tiles, then rays in random directions from their hits
    std::vector<RTCRay> rays;
    for (int i = 0; i < 512 * 512; i++) {
        int tile = i / 256, x = tile % 32 * 16 + i % 16, y = tile / 32 * 16 + i % 256 / 16;
        RTCRay r{};
        float s = std::tan(0.34906585f) / 256;
        r.org_z = -4, r.dir_x = s * (x - 255.5f), r.dir_y = s * (y - 255.5f), r.dir_z = 1, r.tfar = 1e30f, r.mask = ~0u;
        rays.push_back(r);
    }
    for (const char* name : {"camera", "bounce"}) {
        std::vector<RTCRay> next;
        double best = 1e30;
        for (int turn = 0; turn < 5; turn++) {
            next.clear();
            RTCIntersectContext context;
            rtcInitIntersectContext(&context);
            std::vector<RTCRayHit> hits(rays.size());
            for (size_t i = 0; i < rays.size(); i++) {
                hits[i].ray = rays[i];
                hits[i].hit.geomID = hits[i].hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
            }
            start = cpu();
            for (RTCRayHit& hit : hits) rtcIntersect1(scene, &context, &hit);
            best = std::fmin(best, cpu() - start);
            for (RTCRayHit& hit : hits) {
                if (hit.hit.geomID == RTC_INVALID_GEOMETRY_ID) continue;
                RTCRay r = hit.ray;
                float *o = &r.org_x, *d = &r.dir_x, w[3];
                sphere(w);
                for (int k = 0; k < 3; k++) o[k] += d[k] * r.tfar + w[k] * 0.008f, d[k] = w[k];
                r.tfar = 1e30f;
                next.push_back(r);
            }
        }
        printf("%s rays: %.2f µs, %.1f %% hit\n", name, best / rays.size() * 1e6, 100.0 * next.size() / rays.size());
        rays = next;
    }
}
