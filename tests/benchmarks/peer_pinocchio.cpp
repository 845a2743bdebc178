// Driver torque and all reactions over a cycle with Pinocchio in C++, step for step the job of peer_pinocchio.py.

// As the wheel was compiled: its joints are more than Boost's lists hold by default.
#define BOOST_MPL_CFG_NO_PREPROCESSED_HEADERS
#define BOOST_MPL_LIMIT_LIST_SIZE 30
#define BOOST_MPL_LIMIT_VECTOR_SIZE 30
#define BOOST_FUSION_INVOKE_MAX_ARITY 12

#include <pinocchio/algorithm/frames.hpp>
#include <pinocchio/algorithm/jacobian.hpp>
#include <pinocchio/algorithm/joint-configuration.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/multibody.hpp>
#include <pinocchio/spatial.hpp>

namespace pin = pinocchio;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using Square = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

namespace {

const double closed = 1e-11;
const auto local = pin::LOCAL;

struct Chain {
    pin::Model model;
    pin::FrameIndex closing;
    std::vector<pin::JointIndex> first;  // joint that carries the wrench of each pair
};

Chain tree(int pairs, const char* kinds, const double* points, const double* axes, const double* masses,
           const double* centers, const double* inertias, const double* gravity) {
    Chain chain;
    pin::Model& model = chain.model;
    model.gravity.linear() = Eigen::Map<const Vector3d>(gravity);
    pin::JointIndex parent = 0;
    pin::SE3 before = pin::SE3::Identity();
    for (int k = 0; k < pairs; ++k) {
        const Square turn = Eigen::Map<const Square>(axes + 9 * k);
        const Vector3d point = Eigen::Map<const Vector3d>(points + 3 * k);
        const pin::SE3 here(turn, point);
        const pin::SE3 placement = before.actInv(here);
        const std::string name = std::to_string(k);
        if (kinds[k] == 'S')
            parent = model.addJoint(parent, pin::JointModelSpherical(), placement, name);
        else if (kinds[k] == 'P')
            parent = model.addJoint(parent, pin::JointModelPZ(), placement, name);
        else
            parent = model.addJoint(parent, pin::JointModelRZ(), placement, name);
        chain.first.push_back(parent);
        if (kinds[k] == 'C') parent = model.addJoint(parent, pin::JointModelPZ(), pin::SE3::Identity(), name + "z");
        before = here;
        if (masses[k] > 0) {
            const Square about = Eigen::Map<const Square>(inertias + 9 * k);
            const Vector3d center = turn.transpose() * (Eigen::Map<const Vector3d>(centers + 3 * k) - point);
            const pin::Inertia body(masses[k], center, Eigen::Matrix3d(turn.transpose() * about * turn));
            model.appendBodyToJoint(parent, body, pin::SE3::Identity());
        }
    }
    chain.closing = model.addFrame(pin::Frame("closing", parent, 0, before.inverse(), pin::OP_FRAME));
    return chain;
}

// Inverse of the passive columns, by normal equations where the loop is overconstrained.
MatrixXd inverse(const MatrixXd& J) {
    if (J.rows() == J.cols()) return J.partialPivLu().inverse();
    return (J.transpose() * J).ldlt().solve(J.transpose());
}

}  // namespace

extern "C" int solve(int pairs, const char* kinds, const double* points, const double* axes, const double* masses,
                     const double* centers, const double* inertias, const double* gravity, int positions,
                     const double* turned, const double* rate, const double* change, double dt, double* torque,
                     double* wrenches) {
    const Chain chain = tree(pairs, kinds, points, axes, masses, centers, inertias, gravity);
    const pin::Model& model = chain.model;
    pin::Data data(model);
    const pin::SE3 pull = model.frames[chain.closing].placement;
    VectorXd q = pin::neutral(model), v = VectorXd::Zero(model.nv), a = v, step = v;
    std::vector<pin::Force> outer(model.njoints, pin::Force::Zero());
    MatrixXd J(6, model.nv), back;
    for (int i = 0; i < positions; ++i) {
        step = dt * v + 0.5 * dt * dt * a;
        q = pin::integrate(model, q, step);
        q[0] = turned[i];
        for (int round = 0;; ++round) {
            if (round == 30) return i + 1;
            pin::computeJointJacobians(model, data, q);
            const pin::SE3& place = pin::updateFramePlacement(model, data, chain.closing);
            J.setZero();
            pin::getFrameJacobian(model, data, chain.closing, local, J);
            back = inverse(J.rightCols(model.nv - 1));
            const Eigen::Matrix<double, 6, 1> error = pin::log6(place).toVector();
            if (error.cwiseAbs().maxCoeff() < closed) break;
            step.setZero();
            step.tail(model.nv - 1) = -back * error;
            q = pin::integrate(model, q, step);
        }
        v[0] = rate[i];
        v.tail(model.nv - 1) = -back * J.col(0) * rate[i];
        a.setZero();
        a[0] = change[i];
        pin::forwardKinematics(model, data, q, v, a);
        a.tail(model.nv - 1) = -back * pin::getFrameAcceleration(model, data, chain.closing, local).toVector();
        const VectorXd needed = pin::rnea(model, data, q, v, a);
        const Eigen::Matrix<double, 6, 1> force = back.transpose() * needed.tail(model.nv - 1);
        outer[model.njoints - 1] = pull.act(pin::Force(force));
        torque[i] = pin::rnea(model, data, q, v, a, outer)[0];
        for (int k = 0; k < pairs; ++k)
            Eigen::Map<Eigen::Matrix<double, 6, 1>>(wrenches + 6 * (k * positions + i)) = data.f[chain.first[k]].toVector();
    }
    return 0;
}
