// A commit that restructures a refitted tree, or builds another in its place, is interrupted at every single place
// where this is possible. The next commit reuses its memory, in any state, and its tree must equal that of an
// uninterrupted scene.
#include <gtest/gtest.h>

#include <new>

#include "scene/scene.h"
#include "tests/failing_memory.h"
#include "tests/mesh_sets.h"
#include "tests/same_bytes.h"
#include "tests/tree_faults.h"
#include "tests/wide_trees.h"

namespace perfect_bvh::test {
namespace {

enum class Interruption { kStop, kOneAllocationFails, kMemoryRunsOut };

struct Case {
  const char* name;
  Policy policy;
  MeshAction action;
  Interruption interruption;
};

std::ostream& operator<<(std::ostream& out, const Case& each) { return out << each.name; }

class StoppedRestructuring : public testing::TestWithParam<Case> {
 protected:
  StoppedRestructuring() : still_(bumpy_sheet(24)), mesh_(moved(still_, {"", [](Positions& p) { twist(p, 25.0f); }})) {}

  // Prepares a scene in which mesh 0 has moved.
  void begin(Scene& scene) {
    static_cast<void>(scene.add_mesh(Mesh(still_), {}, Usage::kDeforming));
    scene.add_instances(std::vector<InstanceInput>{{0, Affine{}, 1, {}}});
    static_cast<void>(commit(scene, Policy::kRefit));
    scene.update_mesh<float>(0, still_.positions);  // from the first refit on, memory is passed on
    static_cast<void>(commit(scene, Policy::kRefit));
  }

  // The edit before the interrupted commit: another shape or a motion, which no refitted tree can follow.
  void deform(Scene& scene) {
    if (GetParam().action != MeshAction::kRebuilt) return scene.update_mesh<float>(0, mesh_.positions);
    Positions steps = mesh_.positions;
    steps.insert(steps.end(), still_.positions.begin(), still_.positions.end());
    scene.set_mesh_motion(0, std::span<const Vec3f>(steps), StepTimes{0.0f, 1.0f, 1});
  }

  CommitReport commit(Scene& scene, Policy policy) {
    CancelToken cancel;
    return commit(scene, policy, cancel);
  }

  CommitReport commit(Scene& scene, Policy policy, CancelToken& cancel) {
    CommitOptions options;
    options.policy = policy;
    if (policy == Policy::kGoverned) options.expected_rays = 1e12;  // enough to repay a new tree
    return scene.commit(pool_, cancel, options);
  }

  struct Attempt {
    bool is_disturbed = true, is_done = false;
  };
  Attempt attempt(Scene& scene, long after) {
    CancelToken cancel;
    Attempt result;
    try {
      if (GetParam().interruption == Interruption::kStop) {
        StopComes stop(after, cancel);
        static_cast<void>(commit(scene, GetParam().policy, cancel));
        result.is_disturbed = stop.end();
      } else {
        MemoryRunsOut fault(after, GetParam().interruption == Interruption::kMemoryRunsOut);
        static_cast<void>(commit(scene, GetParam().policy, cancel));
        result.is_disturbed = fault.end();
      }
      result.is_done = true;
    } catch (const std::bad_alloc&) {
      result.is_done = false;
    } catch (const Cancelled&) {
      result.is_done = false;
    }
    return result;
  }

  const Mesh still_, mesh_;
  ThreadPool pool_{1};
};

TEST_P(StoppedRestructuring, LeavesNothingBehind) {
  Scene undisturbed;
  begin(undisturbed);
  undisturbed.update_mesh<float>(0, mesh_.positions);
  ASSERT_EQ(commit(undisturbed, Policy::kRefit).meshes[0].action, MeshAction::kRefitted);
  const auto expected = undisturbed.snapshot();
  Scene restructured;
  begin(restructured);
  deform(restructured);
  ASSERT_EQ(commit(restructured, GetParam().policy).meshes[0].action, GetParam().action);
  ASSERT_FALSE(same_bytes(restructured.snapshot()->blases[0]->wide, expected->blases[0]->wide));

  int interruptions = 0;
  for (long after = 0;; ++after) {
    Scene scene;
    begin(scene);
    deform(scene);
    const Attempt tried = attempt(scene, after);
    if (!tried.is_disturbed) break;
    if (tried.is_done) continue;  // a stop after the last poll, or a failed allocation that was optional
    ++interruptions;
    scene.update_mesh<float>(0, mesh_.positions);
    ASSERT_EQ(commit(scene, Policy::kRefit).meshes[0].action, MeshAction::kRefitted);
    const WideBvh& tree = scene.snapshot()->blases[0]->wide;
    ASSERT_EQ(find_wide_fault(tree, mesh_, true), "") << after;
    ASSERT_TRUE(same_bytes(tree, expected->blases[0]->wide)) << after;
  }
  EXPECT_GT(interruptions, 40);
}

INSTANTIATE_TEST_SUITE_P(
    Places, StoppedRestructuring,
    testing::Values(Case{"rotated_stop", Policy::kRotate, MeshAction::kRotated, Interruption::kStop},
                    Case{"rotated_once", Policy::kRotate, MeshAction::kRotated, Interruption::kOneAllocationFails},
                    Case{"rotated_for_good", Policy::kRotate, MeshAction::kRotated, Interruption::kMemoryRunsOut},
                    Case{"rebuilt_stop", Policy::kRebuildParts, MeshAction::kPartlyRebuilt, Interruption::kStop},
                    Case{"rebuilt_once", Policy::kRebuildParts, MeshAction::kPartlyRebuilt,
                         Interruption::kOneAllocationFails},
                    Case{"new_tree_stop", Policy::kGoverned, MeshAction::kRebuilt, Interruption::kStop},
                    Case{"new_tree_once", Policy::kGoverned, MeshAction::kRebuilt, Interruption::kOneAllocationFails}),
    [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace perfect_bvh::test
