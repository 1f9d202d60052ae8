#include "core/factor/inertial_batch.h"
#include <Eigen/LU>
namespace selfcal {
void InertialBatch::Linearise(std::span<const InertialLinkStates> links, const ImuCalibration& imu, const ImuNoise& noise, double gravity, std::span<InertialNoiseRoot>, bool, InertialTransition* out) {
  for (std::size_t i=0;i<links.size();++i) {
    InertialJacobians J; InertialMatrix C;
    auto r=EvaluateInertial(links[i].samples,*links[i].x0,*links[i].x1,imu,noise,gravity,&J,&C);
    InertialMatrix W=SquareRootInformation(C);
    InertialResidual wr=W*r;
    InertialTransition& t=out[i]; 
    std::fill(&t.G[0][0],&t.G[0][0]+15*32,0.0); std::fill(&t.A[0][0],&t.A[0][0]+15*16,0.0);
    Eigen::Map<Eigen::Matrix<double,15,32,Eigen::RowMajor>> G(&t.G[0][0]);
    Eigen::Map<Eigen::Matrix<double,15,16,Eigen::RowMajor>> A(&t.A[0][0]);
    Eigen::PartialPivLU<InertialMatrix> lu(J.x0);
    A.leftCols<15>()=lu.solve(W.triangularView<Eigen::Upper>().solve(InertialMatrix::Identity()).eval());
    G.leftCols<15>()=-lu.solve(J.theta);
    InertialMatrix n=-lu.solve(J.x1);
    G.middleCols<9>(15)=n.rightCols<9>(); G.col(24)=-lu.solve(r); G.middleCols<6>(25)=n.leftCols<6>();
    for(int k=0;k<15;++k) t.whitened[k]=wr(k);
  }
}
}
