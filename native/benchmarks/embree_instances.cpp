#include <stdexcept>
#include <vector>

#include "embree_peer.h"
#include "embree_rays.h"
#include "instance_scene.h"

namespace perfect_bvh::bench {
namespace {

// Copies columns of three rows each; `stride` floats from column to column.
void write_columns(const Affine& map, float* out, std::size_t stride) {
  for (const Vec3d& column : {map.x, map.y, map.z, map.translation}) {
    for (int axis = 0; axis < 3; ++axis) out[axis] = static_cast<float>(column[axis]);
    out += stride;
  }
}

struct Options {
  std::string device;
  RTCBuildQuality quality = RTC_BUILD_QUALITY_MEDIUM;  // of the scene over the instances
  bool is_dynamic = false;
};

// The device, the mesh's scene, and the scene over the instances.
class EmbreeInstances : public InstanceScene {
 public:
  EmbreeInstances(const Mesh& mesh, const Options& options) : scenes_(std::make_shared<Scenes>(options.device)) {
    const EmbreeFloatingPoint mode;
    add_mesh(scenes_->device, scenes_->mesh, mesh);
    rtcCommitScene(scenes_->mesh);
    if (options.is_dynamic) rtcSetSceneFlags(scenes_->top, RTC_SCENE_FLAG_DYNAMIC);
    rtcSetSceneBuildQuality(scenes_->top, options.quality);
    quality_ = options.quality;
  }

  void commit() override {
    const EmbreeFloatingPoint mode;
    rtcCommitScene(scenes_->top);
  }

 protected:
  struct Scenes {
    RTCDevice device;
    RTCScene mesh, top;

    explicit Scenes(const std::string& options)
        : device(rtcNewDevice(options.c_str())), mesh(rtcNewScene(device)), top(rtcNewScene(device)) {}
    ~Scenes() {
      rtcReleaseScene(top);
      rtcReleaseScene(mesh);
      rtcReleaseDevice(device);
    }
    Scenes(const Scenes&) = delete;
    Scenes& operator=(const Scenes&) = delete;
  };

  [[nodiscard]] RTCGeometry new_geometry(RTCGeometryType type) const {
    RTCGeometry geometry = rtcNewGeometry(scenes_->device, type);
    rtcSetGeometryInstancedScene(geometry, scenes_->mesh);
    rtcSetGeometryBuildQuality(geometry, quality_);
    return geometry;
  }

  const std::shared_ptr<Scenes> scenes_;

 private:
  RTCBuildQuality quality_;
};

// One geometry for each instance.
class Geometries : public EmbreeInstances {
 public:
  using EmbreeInstances::EmbreeInstances;
  ~Geometries() override {
    for (RTCGeometry geometry : geometries_) rtcReleaseGeometry(geometry);
  }

  void prepare(std::span<const Affine> transforms) override {
    columns_.resize(12 * transforms.size());
    for (std::size_t i = 0; i < transforms.size(); ++i) write_columns(transforms[i], &columns_[12 * i], 3);
  }
  void add() override {
    const EmbreeFloatingPoint mode;
    geometries_.resize(columns_.size() / 12);
    for (RTCGeometry& geometry : geometries_) {
      geometry = new_geometry(RTC_GEOMETRY_TYPE_INSTANCE);
      rtcAttachGeometry(scenes_->top, geometry);
    }
    move();
  }
  void move() override {
    const EmbreeFloatingPoint mode;
    for (std::size_t i = 0; i < geometries_.size(); ++i) {
      rtcSetGeometryTransform(geometries_[i], 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, &columns_[12 * i]);
      rtcCommitGeometry(geometries_[i]);
    }
  }
  [[nodiscard]] std::shared_ptr<RayCaster> caster() const override {
    return std::make_shared<EmbreeRays>(scenes_, scenes_->top, EmbreeInstanceIds::kGeometry);
  }

 private:
  std::vector<float> columns_;
  std::vector<RTCGeometry> geometries_;
};

// All instances in one array. Its buffer is filled before timing starts: an application writes its transforms there.
class Array : public EmbreeInstances {
 public:
  using EmbreeInstances::EmbreeInstances;
  ~Array() override {
    if (geometry_ != nullptr) rtcReleaseGeometry(geometry_);
  }

  void prepare(std::span<const Affine> transforms) override {
    buffer_.resize(16 * transforms.size());
    for (std::size_t i = 0; i < transforms.size(); ++i) {
      write_columns(transforms[i], &buffer_[16 * i], 4);
      buffer_[16 * i + 15] = 1.0f;
    }
  }
  void add() override {
    const EmbreeFloatingPoint mode;
    geometry_ = new_geometry(RTC_GEOMETRY_TYPE_INSTANCE_ARRAY);
    rtcSetSharedGeometryBuffer(geometry_, RTC_BUFFER_TYPE_TRANSFORM, 0, RTC_FORMAT_FLOAT4X4_COLUMN_MAJOR,
                               buffer_.data(), 0, 16 * sizeof(float), buffer_.size() / 16);
    rtcCommitGeometry(geometry_);
    rtcAttachGeometry(scenes_->top, geometry_);
  }
  void move() override {
    const EmbreeFloatingPoint mode;
    rtcUpdateGeometryBuffer(geometry_, RTC_BUFFER_TYPE_TRANSFORM, 0);
    rtcCommitGeometry(geometry_);
  }
  [[nodiscard]] std::shared_ptr<RayCaster> caster() const override {
    return std::make_shared<EmbreeRays>(scenes_, scenes_->top, EmbreeInstanceIds::kRow);
  }

 private:
  std::vector<float> buffer_;  // 16 floats a transform, by columns
  RTCGeometry geometry_ = nullptr;
};

}  // namespace

std::unique_ptr<InstanceScene> make_embree_instances(const std::string& name, const Mesh& mesh, int thread_count) {
  Options options;
  options.device = "threads=" + std::to_string(thread_count);
  if (name == "low" || name == "array_low") options.quality = RTC_BUILD_QUALITY_LOW, options.is_dynamic = true;
  if (name == "embree" || name == "low") return std::make_unique<Geometries>(mesh, options);
  if (name == "array" || name == "array_low") return std::make_unique<Array>(mesh, options);
  throw std::runtime_error("no peer is called " + name + "; there are embree, low, array, array_low");
}

}  // namespace perfect_bvh::bench
