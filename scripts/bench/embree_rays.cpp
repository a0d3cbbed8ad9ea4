// Traces the rays that the example ray_speed has left in a folder with Embree 3 or 4, on so many threads, and prints what it prints.
//   embree_rays FOLDER THREADS
// Alpha is not asked for, so that its rays are cheaper than a bake's in scenes with masks.
#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#define LATEST 1
#else
#include <embree3/rtcore.h>
#endif

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <limits>
#include <string>
#include <thread>
#include <vector>

static std::vector<float> read(const std::string &path) {
    std::ifstream file(path, std::ios::binary | std::ios::ate);
    if (!file) {
        std::fprintf(stderr, "%s cannot be read\n", path.c_str());
        std::exit(6);
    }
    std::vector<float> values(static_cast<size_t>(file.tellg()) / sizeof(float));
    file.seekg(0);
    file.read(reinterpret_cast<char *>(values.data()), values.size() * sizeof(float));
    return values;
}

static RTCRayHit ray_of(const float *values, bool to_point) {
    RTCRayHit ray{};
    float way[3] = {values[3], values[4], values[5]};
    float reach = std::numeric_limits<float>::infinity();
    if (to_point) {
        for (int axis = 0; axis < 3; axis++) way[axis] -= values[axis];
        reach = std::sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2]);
        for (float &component : way) component /= reach;
    }
    ray.ray.org_x = values[0];
    ray.ray.org_y = values[1];
    ray.ray.org_z = values[2];
    ray.ray.dir_x = way[0];
    ray.ray.dir_y = way[1];
    ray.ray.dir_z = way[2];
    ray.ray.tfar = reach;
    ray.ray.mask = ~0u;
    ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    return ray;
}

static void trace(RTCScene scene, const std::vector<float> &rays, bool to_point, size_t first, size_t last, size_t *met) {
    size_t count = 0;
    for (size_t index = first; index < last; index++) {
        RTCRayHit ray = ray_of(&rays[6 * index], to_point);
#ifdef LATEST
        to_point ? rtcOccluded1(scene, &ray.ray) : rtcIntersect1(scene, &ray);
#else
        RTCIntersectContext context;
        rtcInitIntersectContext(&context);
        to_point ? rtcOccluded1(scene, &context, &ray.ray) : rtcIntersect1(scene, &context, &ray);
#endif
        count += to_point ? ray.ray.tfar < 0.0f : ray.hit.geomID != RTC_INVALID_GEOMETRY_ID;
    }
    *met = count;
}

int main(int argc, char **argv) {
    if (argc != 3) {
        std::fprintf(stderr, "usage: embree_rays FOLDER THREADS\n");
        return 2;
    }
    const std::string folder = argv[1];
    const size_t threads = std::max(1, std::atoi(argv[2]));
    const std::vector<float> triangles = read(folder + "/triangles");
    RTCDevice device = rtcNewDevice(("threads=" + std::to_string(threads)).c_str());
    RTCScene scene = rtcNewScene(device);
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    const size_t n_corners = triangles.size() / 3;
    auto *vertices = static_cast<float *>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), n_corners));
    std::copy(triangles.begin(), triangles.end(), vertices);
    auto *indices = static_cast<unsigned *>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(unsigned), n_corners / 3));
    for (size_t corner = 0; corner < n_corners; corner++) indices[corner] = static_cast<unsigned>(corner);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    rtcCommitScene(scene);
    for (const char *name : {"gather", "visibility"}) {
        const std::vector<float> rays = read(folder + "/" + name);
        const size_t count = rays.size() / 6;
        std::vector<double> seconds;
        for (int run = 0; run < 3; run++) {
            const auto began = std::chrono::steady_clock::now();
            std::vector<size_t> met(threads);
            std::vector<std::thread> workers;
            for (size_t worker = 0; worker < threads; worker++) {
                workers.emplace_back(trace, scene, std::cref(rays), std::string(name) == "visibility", count * worker / threads,
                                     count * (worker + 1) / threads, &met[worker]);
            }
            for (auto &worker : workers) worker.join();
            seconds.push_back(std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count());
        }
        std::sort(seconds.begin(), seconds.end());
        std::printf("embree %s %zu %.4f %.2f\n", name, count, seconds[1], count / seconds[1] / 1e6);
    }
    rtcReleaseScene(scene);
    rtcReleaseDevice(device);
}
