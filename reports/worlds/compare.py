# Makes residuals.png, worlds.png and the first table of README.md from four folders: hw (the real walls), f (formula),
# s (speckle, with --infrared) and room (simulate --room).
import numpy as np, json
from PIL import Image
import matplotlib; matplotlib.use('Agg'); import matplotlib.pyplot as plt
def load(rec,v):
    r=json.load(open(f'{rec}/recording.json')); l=[x for x in open(f'{rec}/{v}/depth.txt') if x[0]!='#'][0].split()[1]
    a=np.array(Image.open(f'{rec}/{v}/{l}')).astype(float); d=r['raw_disparity']
    a[a==d['invalid']]=np.nan
    return a,r
def resid(a):
    v,u=np.mgrid[0:a.shape[0],0:a.shape[1]]; A=np.stack([np.ones_like(u),u,v],-1).reshape(-1,3).astype(float)
    y=a.ravel(); m=np.isfinite(y)
    for _ in range(10):
        p=np.linalg.lstsq(A[m],y[m],rcond=None)[0]; e=y-A@p; s=1.4826*np.nanmedian(abs(e)); m=abs(e)<4.7*s
    return (y-A@p).reshape(a.shape)
fig,ax=plt.subplots(2,3,figsize=(12,6),dpi=100,gridspec_kw=dict(hspace=.12,wspace=.06))
for k,(rec,name) in enumerate([('hw','real: Herrera, wall at %.2f m'),('f','by formula, 9 px window'),('s','by light')]):
    a,r=load(rec,'0038'); e=resid(a)
    if k==0: 
        z=1/(r['raw_disparity']['offset']+r['raw_disparity']['slope']*np.nanmedian(a)); name=name%z
    ax[0,k].imshow(e,cmap='RdBu',vmin=-4,vmax=4); ax[0,k].set_title(name,fontsize=11); ax[0,k].axis('off')
    lo=__import__('scipy.ndimage',fromlist=['x']).uniform_filter(np.nan_to_num(e),49); im=ax[1,k].imshow((e-lo)[180:300,260:420],cmap='RdBu',vmin=-4,vmax=4,interpolation='nearest'); ax[1,k].axis('off'); ax[1,k].set_title('middle, less a 49 px mean',fontsize=9)
    hp=e-__import__('scipy.ndimage',fromlist=['x']).uniform_filter(np.nan_to_num(e),15)
    print(rec,'sd',np.nanstd(e),'highpass sd',np.nanstd(hp), 'acf', [round(float(np.nanmean(hp[:,:-l]*hp[:,l:])/np.nanvar(hp)),2) for l in (1,4,9)], 'nan',np.isnan(a).mean())
cb=fig.colorbar(im,ax=ax,shrink=.8); cb.set_label('residual to a plane, steps of 1/8 px')
fig.savefig('residuals.png',bbox_inches='tight')
ir=np.array(Image.open('s/0038/ir/0000.png')).astype(float)
Image.fromarray(np.clip(ir[180:300,260:420]/np.percentile(ir,99.5)*255,0,255).astype('u1')).resize((640,480),0).save('ir.png')
import glob
i=sorted(glob.glob('room/rgb/*.png'))[10]; Image.open(i).save('rgb.png')
d=np.array(Image.open(sorted(glob.glob('room/depth/*.png'))[10])).astype(float)/5000
plt.imsave('depth.png',d,cmap='viridis',vmin=0.5,vmax=5)
W=[Image.open(x).convert('RGB').resize((640,480)) for x in ('ir.png','rgb.png','depth.png')]
s=Image.new('RGB',(1920,480)); [s.paste(w,(640*k,0)) for k,w in enumerate(W)]; s.save('worlds.png')
